"""Techniques of the comparison, one file each, with the interface in ``method.py``."""
