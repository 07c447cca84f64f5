"""Exporters, and import of poses from files of other programs."""
