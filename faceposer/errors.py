"""Errors that a user can cause and mend."""


class FacePoserError(Exception):
    """A problem told to the user in one sentence: what is wrong, where, and what to do about it."""


class NoWindowError(FacePoserError):
    """The system shows no window: it has no display, or no OpenGL that is up to it. All but the window still works."""
