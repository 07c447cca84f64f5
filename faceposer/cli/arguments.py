"""Command-line options shared by several commands."""

import argparse
import math
import re
from collections.abc import Callable
from pathlib import Path

from faceposer.files.numbers import plain_float


def output_path(text: str) -> Path:
    """Parse ``text`` as the path of an output.

    Raises:
        ArgumentTypeError: If it is empty.
    """
    if not text.strip():
        raise argparse.ArgumentTypeError("its name is empty; give a file or folder")
    return Path(text)


def number(text: str) -> float:
    """Parse ``text`` as a number in plain digits, without "_" or the digits of other scripts; NaN if it is none."""
    try:
        return plain_float(text)
    except ValueError:
        return math.nan


def whole_number(text: str, least: int, most: int) -> int | None:
    """Parse ``text`` as a whole number from ``least`` to ``most`` in plain digits; None if it is none."""
    # The length is checked first, since the time for conversion grows with its square.
    if not (text.isascii() and text.isdigit() and len(text) <= len(str(most))) or not least <= int(text) <= most:
        return None
    return int(text)


def whole_between(least: int, most: int) -> Callable[[str], int]:
    """Return a parser of whole numbers from ``least`` to ``most`` for the ``type`` of an argument."""

    def parse(text: str) -> int:
        value = whole_number(text, least, most)
        if value is None:
            raise argparse.ArgumentTypeError(f"'{text}' is not a whole number from {least} to {most}")
        return value

    return parse


def number_between(text: str, least: float, most: float) -> float:
    """Parse ``text`` as a number from ``least`` to ``most``.

    Raises:
        ArgumentTypeError: If ``text`` is not such a number.
    """
    value = number(text)
    if not least <= value <= most:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number from {least:g} to {most:g}")
    return value


def frame_rate(text: str) -> float:
    """Parse ``text`` as frames per second: a number from 0.001 to 1000, or a fraction such as 30000/1001.

    Raises:
        ArgumentTypeError: If ``text`` is neither.
    """
    match = re.fullmatch(r"\s*(\d{1,7}(?:\.\d+)?)\s*/\s*(\d{1,7}(?:\.\d+)?)\s*", text)
    if match is not None and float(match[2]) > 0.0 and 1e-3 <= float(match[1]) / float(match[2]) <= 1e3:
        return float(match[1]) / float(match[2])
    try:
        return number_between(text, 1e-3, 1e3)
    except argparse.ArgumentTypeError as error:
        raise argparse.ArgumentTypeError(f"{error} or a fraction such as 30000/1001") from None


def add_spread(parser: argparse.ArgumentParser, default: str) -> None:
    """Add ``--spread`` to ``parser``; its value is None unless given, and the help names ``default``."""
    parser.add_argument(
        "--spread",
        type=lambda text: number_between(text, 0.0, 1.0),
        metavar="S",
        help=f"how much of the face follows, from 0 (only the pulled part) to 1 (the whole face) (default: {default})",
    )


def add_rate_option(parser: argparse.ArgumentParser, subject: str) -> None:
    """Add ``--rate`` to ``parser``, the frame rate of ``subject`` in place of that of its file."""
    parser.add_argument(
        "--rate",
        type=frame_rate,
        metavar="FPS",
        help=f"frame rate of {subject}, in place of the one that the file states or its times give",
    )


def add_contact_option(parser: argparse.ArgumentParser) -> None:
    """Add ``--no-contact`` to ``parser``."""
    parser.add_argument(
        "--no-contact",
        dest="contact",
        action="store_false",
        help="skip the contact step of meshes and images: lids, lips and teeth may then intersect. Morph targets "
        "(.glb) and weights (.csv, .json) never contain contact",
    )


def add_materials_option(parser: argparse.ArgumentParser) -> None:
    """Add ``--no-materials`` to ``parser``."""
    parser.add_argument(
        "--no-materials",
        dest="materials",
        action="store_false",
        help="write .obj without its .mtl and textures",
    )


def image_size(text: str, least: int, most: int, example: str = "960x720") -> tuple[int, int]:
    """Parse ``text``, written as ``WxH``, as the width and height of an image.

    Raises:
        ArgumentTypeError: If ``text`` is not a size, or a side is not from ``least`` to ``most`` pixels.
    """
    match = re.fullmatch(r"([0-9]{1,5})[xX]([0-9]{1,5})", text)
    sides = tuple(int(side) for side in match.groups()) if match else ()
    if len(sides) != 2 or not all(least <= side <= most for side in sides):
        raise argparse.ArgumentTypeError(f"'{text}' is not a size such as {example}, with sides from {least} to {most}")
    return (sides[0], sides[1])
