"""Heads from scans: landmarks, a fit of the morphable model, detail beyond it, and a texture (docs/identity.md)."""
