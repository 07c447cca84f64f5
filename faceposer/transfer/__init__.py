"""Expressions carried from one face to another."""
