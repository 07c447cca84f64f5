"""Posing from a photo: the image, its pins and its camera."""
