"""The techniques that are compared, one file each, behind the interface in ``method.py``."""
