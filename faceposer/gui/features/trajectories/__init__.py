"""Trajectories drawn over the face, and the animation solved to follow them."""
