"""Heads from photos, measured on synthetic photos of heads that are known."""
