"""Heads, expressions, cameras and light from photos."""
