"""Identities: a morphable model of heads, and characters made from it (Blanz and Vetter, SIGGRAPH 1999)."""
