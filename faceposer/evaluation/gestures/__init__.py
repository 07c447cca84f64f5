"""Scripted gestures of an artist, and how a face answers them: `scripts/study_gestures.py`, docs/gestures.md."""
