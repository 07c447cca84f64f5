"""Accuracy of sketching: strokes with the errors of a hand, drawn from poses that no model has seen (docs/sketching.md)."""
