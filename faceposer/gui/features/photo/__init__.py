"""Posing after photos."""
