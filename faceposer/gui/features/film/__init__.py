"""Expressions from films in the window (docs/film.md)."""
