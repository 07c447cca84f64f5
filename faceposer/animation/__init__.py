"""Animation: keyframes with splines between them, and faces solved for the trajectories of a few points."""
