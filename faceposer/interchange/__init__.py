"""Poses and animations to and from the files of other programs."""
