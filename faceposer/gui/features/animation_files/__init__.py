"""Import of animations and trajectories, and key reduction."""
