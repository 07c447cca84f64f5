"""Errors that a user can cause and mend."""


class FacePoserError(Exception):
    """A problem told to the user in one sentence: what is wrong, where, and what to do about it."""
