"""Dialogs that make a character of scans or photos of a person: what both have in common."""
