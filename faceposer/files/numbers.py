"""Numbers in text files and options: plain digits only, without the "_" and the digits of other scripts of Python."""


def plain_float(word: str) -> float:
    """Return the number in ``word``, which may be infinite or not a number.

    Raises:
        ValueError: If it is none.
    """
    if not is_plain(word):
        raise ValueError("it is not a number in plain digits")
    return float(word)


def plain_int(word: str) -> int:
    """Return the whole number in ``word``.

    Raises:
        ValueError: If it is none.
    """
    if not is_plain(word):
        raise ValueError("it is not a number in plain digits")
    return int(word)


def is_plain(word: str) -> bool:
    """Return True if numbers in ``word`` can only be in plain digits."""
    return word.isascii() and "_" not in word
