"""Errors that a user can cause and mend, and warnings of what may not be as it was meant."""


class FacePoserError(Exception):
    """A problem told to the user in one sentence: what is wrong, where, and what to do about it."""


class NoWindowError(FacePoserError):
    """The system shows no window: it has no display, or no OpenGL that is up to it. All but the window still works."""


class FacePoserWarning(UserWarning):
    """A remark told to the user of Python's interface: what was changed, or may not be as it was meant."""
