"""Range marks: outlines of how far a point can move."""
