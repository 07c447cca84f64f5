"""Scripted gestures of an artist and their effects on a face: `scripts/study_gestures.py`, docs/gestures.md."""
