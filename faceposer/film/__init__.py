"""Expressions of a person in a film, frame by frame (docs/film.md)."""
