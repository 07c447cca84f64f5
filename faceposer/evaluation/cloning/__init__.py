"""Rivals and measures of cloning by examples (docs/cloning.md)."""
