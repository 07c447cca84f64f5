"""Names and credits of characters."""

from faceposer.errors import FacePoserError
from faceposer.resources import asset_path

LONGEST_TITLE = 80


def checked_title(text: object, label: str = "The name of a character") -> str:
    """Return a name for display without spaces around it.

    Raises:
        FacePoserError: If ``text`` is no text, empty, too long or not printable; the message begins with ``label``.
    """
    title = text.strip() if isinstance(text, str) else ""
    if not 0 < len(title) <= LONGEST_TITLE or not title.isprintable():
        raise FacePoserError(f"{label} must have 1 to {LONGEST_TITLE} printable characters.")
    return title


def checked_short_name(text: object, label: str) -> str:
    """Return a short name for commands and files without spaces around it.

    Raises:
        FacePoserError: If it is not possible for display, is a path, or is that of an installed character; the message
            begins with ``label``.
    """
    name = checked_title(text, label)
    if any(mark in name for mark in "/\\:") or set(name) == {"."}:
        raise FacePoserError(f"{label} cannot be a path such as '{name}'; give a name such as 'my-head'.")
    if is_installed(name):
        raise FacePoserError(f"{label} cannot be '{name}', which is a built-in character; give another name.")
    return name


def is_installed(name: str) -> bool:
    """Return True if an installed character has the short ``name``, in upper or lower case."""
    return name.casefold() in {path.stem.casefold() for path in asset_path("characters").glob("*.npz")}


def file_stem(title: str) -> str:
    """Return the stem of a file name for a character of this ``title``."""
    return "".join(letter if letter.isalnum() else "-" for letter in title.lower()).strip("-") or "head"


def joined_credits(*sources: str) -> str:
    """Return the sources of a character's data in one text, each once."""
    credits: list[str] = []
    for text in sources:
        if text and not any(text in before for before in credits):
            credits.append(text)
    return " ".join(credits)
