"""Command-line options that several commands share."""

import argparse
import math


def number_between(text: str, least: float, most: float) -> float:
    """Return the number ``text``, from ``least`` to ``most``.

    Raises:
        ArgumentTypeError: If it is none.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not least <= value <= most:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number from {least:g} to {most:g}")
    return value


def add_spread(parser: argparse.ArgumentParser, default: str) -> None:
    """Add ``--spread`` to ``parser``; its value is None unless given, and ``default`` says what then holds."""
    parser.add_argument(
        "--spread",
        type=lambda text: number_between(text, 0.0, 1.0),
        metavar="S",
        help=f"how much of the face follows, from 0 (only what was pulled) to 1 (the whole face) (default: {default})",
    )
