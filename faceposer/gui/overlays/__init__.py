"""Overlays of the view for constraints."""
