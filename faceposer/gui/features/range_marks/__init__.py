"""Range marks: how far a point can move."""
