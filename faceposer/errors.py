"""Errors that a user can cause and fix, and warnings about possibly unintended results."""


class FacePoserError(Exception):
    """A problem reported to the user in one sentence: what is wrong, where, and how to fix it."""


class NoWindowError(FacePoserError):
    """The system cannot show a window, because there is no display or no sufficient OpenGL; commands still work."""


class MissingCharacterError(FacePoserError):
    """The character of a session is not found.

    Attributes:
        character: Name or path of the character.
    """

    def __init__(self, message: str, character: str) -> None:
        super().__init__(message)
        self.character = character


class FacePoserWarning(UserWarning):
    """A remark for users of the Python interface about changes or possibly unintended results."""
