"""Sketches in the window: the recogniser in the background, names at the strokes, and the list of features."""
