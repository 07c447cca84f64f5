"""Accuracy of sketching, from strokes with the errors of a hand on unseen poses (docs/sketching.md)."""
