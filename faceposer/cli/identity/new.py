"""``faceposer identity new``: makes a character with a random head."""

import argparse
import dataclasses
from typing import Any

from faceposer.cli.arguments import number_between, whole_number
from faceposer.cli.identity.heads import (
    HEAD_HELP,
    add_output_options,
    add_shape_options,
    changed_head,
    check_names,
    opened_head,
    values_of,
    write_head,
)

NAME = "new"
_MOST_SEED = 2**32 - 1


def add_parser(subcommands: Any) -> None:
    """Add the parser of ``new`` to ``subcommands``."""
    parser = subcommands.add_parser(
        NAME,
        help="make a character with a random head",
        description="Make a character with a random head, reproducible by its seed (docs/identity.md).",
    )
    add_output_options(parser)
    parser.add_argument("--seed", type=_seed, default=0, metavar="N", help="seed of the head and its skin (default: 0)")
    parser.add_argument(
        "--base", default="man", metavar="CHARACTER", help=f"character whose head is replaced: {HEAD_HELP}"
    )
    parser.add_argument(
        "--variety",
        type=lambda text: number_between(text, 0.0, 2.0),
        default=0.8,
        metavar="V",
        help="spread of heads relative to people: 0 is the average head (default: 0.8)",
    )
    parser.add_argument(
        "--segments",
        nargs="+",
        action="extend",
        default=[],
        metavar="SEGMENT",
        help="parts of the head that are random: eyes, nose, mouth, rest; the others are those of the base",
    )
    parser.add_argument(
        "--set", nargs="+", action="extend", default=[], metavar="NAME=VALUE", help="attributes, such as age=0.5"
    )
    add_shape_options(parser)


def _seed(text: str) -> int:
    seed = whole_number(text, 0, _MOST_SEED)
    if seed is None:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number from 0 to {_MOST_SEED}")
    return seed


def run(options: argparse.Namespace) -> int:
    """Make the head, write the character and return the exit status."""
    check_names(options, options.base)
    values = values_of(options.set, "--set")
    from faceposer.identity.head_choices import RANDOM_SKIN, checked_segments

    head = opened_head(options.base)
    free = checked_segments(head.editor, options.segments) or None
    if options.texture is None and free is None:
        options.texture = RANDOM_SKIN
    drawn = head.editor.random(options.seed, head.identity, free, options.variety)
    identity = changed_head(options, dataclasses.replace(head, identity=drawn), values, options.seed)
    write_head(options, head.editor, identity)
    return 0
