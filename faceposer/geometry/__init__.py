"""Meshes, cameras, picking and file formats: geometry independent of face models."""
