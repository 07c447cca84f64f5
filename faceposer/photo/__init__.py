"""Posing a face after a photo: the picture, the pins on it and the camera that took it."""
