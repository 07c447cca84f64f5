"""Conversion of the landmark networks to Face Poser's array file."""
