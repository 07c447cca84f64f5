"""Sketching: from a drawn stroke to the feature of the face it depicts, and to a pose (docs/sketching.md)."""
