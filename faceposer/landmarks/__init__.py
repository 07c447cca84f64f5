"""Landmarks of faces: detection, 468 points and irises in images, and on meshes by drawing them (docs/landmarks.md)."""
