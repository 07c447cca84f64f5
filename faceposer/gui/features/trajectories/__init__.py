"""Trajectories drawn over the face, and the animation that follows them."""
