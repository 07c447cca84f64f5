"""Heads from photos in the window (docs/photo-heads.md)."""
