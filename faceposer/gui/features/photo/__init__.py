"""Posing from photos."""
