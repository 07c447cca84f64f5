"""Drawings that pose the face."""
