"""Heads from scans in the window (docs/identity.md)."""
