"""Errors that a user can cause and fix, warnings about possibly unintended results, and text that is safe to show."""

import unicodedata

_LONGEST_NAME, _LONGEST_MESSAGE = 80, 1000


class FacePoserError(Exception):
    """A problem reported to the user in one sentence: what is wrong, where, and how to fix it.

    Text quoted from files is displayed by ``printable``.
    """

    def __init__(self, message: object = "") -> None:
        super().__init__(printable(str(message)))


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


class NoSessionError(FacePoserError):
    """A file that was given in place of a session is of another kind.

    Attributes:
        path: Path of the file.
    """

    def __init__(self, message: str, path: str) -> None:
        super().__init__(message)
        self.path = path


class FacePoserWarning(UserWarning):
    """A remark for users of the Python interface about changes or possibly unintended results."""


def printable(text: str, most: int = _LONGEST_MESSAGE) -> str:
    """Return ``text`` in one line for display: control characters and lone surrogates escaped, its middle cut out.

    Args:
        text: Text that may come from a file.
        most: Maximum number of characters.
    """
    # Cut before and after, since an escaped character is longer.
    text = _cut(text, most)
    if text.isprintable():
        return text
    escaped = (char if is_shown(char) else char.encode("unicode_escape").decode("ascii") for char in text)
    return _cut("".join(escaped), most)


def _cut(text: str, most: int) -> str:
    if len(text) <= most:
        return text
    begin = 2 * (most - 5) // 3
    return f"{text[:begin]} ... {text[len(text) - (most - 5 - begin) :]}"


def there_are(count: int, one: str, many: str = "") -> str:
    """Return a clause such as "there is 1 vertex"; see ``counted`` for the arguments."""
    return f"there {'is' if count == 1 else 'are'} {counted(count, one, many)}"


def is_shown(char: str) -> bool:
    """Return True if ``char`` can be seen, or is a space."""
    return char.isprintable() or unicodedata.category(char) == "Zs"


def counted(count: int, one: str, many: str = "") -> str:
    """Return ``count`` with the noun for it, such as "1 vertex".

    Args:
        count: The number.
        one: The noun in the singular.
        many: The noun in the plural; "" for one with an added "s".
    """
    return f"{count} {one if count == 1 else many or f'{one}s'}"


def short_name(name: str) -> str:
    """Return a name from a file for display in a sentence, by ``printable``, of at most 80 characters."""
    return printable(name, _LONGEST_NAME)
