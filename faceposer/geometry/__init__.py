"""Meshes, cameras and picking: geometry that knows nothing of faces."""
