"""``faceposer identity mix``: makes a character with a head between two others."""

import argparse
from typing import Any

from faceposer.cli.arguments import number_between
from faceposer.cli.identity.heads import HEAD_HELP, add_output_options, check_names, opened_head, write_head

NAME = "mix"


def add_parser(subcommands: Any) -> None:
    """Add the parser of ``mix`` to ``subcommands``."""
    parser = subcommands.add_parser(
        NAME,
        help="make a character with a head between two others",
        description="Make a character with a head and a skin between those of two characters (docs/identity.md).",
    )
    parser.add_argument("first", metavar="A", help=f"{HEAD_HELP}; all but head and skin are its own")
    parser.add_argument("second", metavar="B", help=HEAD_HELP)
    parser.add_argument(
        "--share",
        type=lambda text: number_between(text, 0.0, 1.0),
        default=0.5,
        metavar="S",
        help="share of B: 0 gives the head of A, 1 that of B (default: 0.5)",
    )
    add_output_options(parser)


def run(options: argparse.Namespace) -> int:
    """Mix the heads, write the character and return the exit status."""
    check_names(options, options.first, options.second)
    from faceposer.identity.head_choices import mixed_heads

    one, other = opened_head(options.first), opened_head(options.second)
    write_head(options, one.editor, mixed_heads(one.editor, one.identity, other.editor, other.identity, options.share))
    return 0
