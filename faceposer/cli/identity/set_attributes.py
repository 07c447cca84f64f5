"""``faceposer identity set``: makes a character with other attributes of its head."""

import argparse
from typing import Any

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
from faceposer.errors import FacePoserError

NAME = "set"


def add_parser(subcommands: Any) -> None:
    """Add the parser of ``set`` to ``subcommands``."""
    parser = subcommands.add_parser(
        NAME,
        help="make a character with other attributes, caricature or skin",
        description="Make a character whose head has other attributes than that of a character; attributes that are "
        "not named stay as they are (docs/identity.md).",
    )
    parser.add_argument("character", metavar="CHARACTER", help=HEAD_HELP)
    parser.add_argument(
        "values", nargs="*", metavar="NAME=VALUE", help="attributes and their values, such as age=0.5 nose-length=-0.3"
    )
    add_output_options(parser)
    add_shape_options(parser)


def run(options: argparse.Namespace) -> int:
    """Change the head, write the character and return the exit status."""
    check_names(options, options.character)
    values = values_of(options.values, "The attribute")
    if not values and options.caricature == 1.0 and options.texture is None and options.tone is None:
        raise FacePoserError(
            "No change is given; name attributes, such as age=0.5, or use --caricature, --texture or --tone."
        )
    head = opened_head(options.character)
    write_head(options, head.editor, changed_head(options, head, values))
    return 0
