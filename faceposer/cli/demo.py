"""``faceposer demo``: plays a scripted posing session in the program itself, without a display."""

import argparse
from typing import Any

from faceposer.cli.arguments import output_path
from faceposer.files.atomic import check_new_folder

NAME = "demo"


def add_parser(commands: Any) -> None:
    """Add the parser of ``demo`` to ``commands``."""
    parser = commands.add_parser(
        NAME,
        help="play a scripted posing session",
        description="Play a scripted posing session in the program itself, without a display, and write what the "
        "window shows as images and an animation.",
    )
    parser.add_argument("-o", "--output", type=output_path, metavar="DIR", required=True, help="folder to write into")


def run(options: argparse.Namespace) -> int:
    """Write the demo's images and animation and return the exit status."""
    check_new_folder(options.output)
    from faceposer.gui.testing.demo import run as play

    play(options.output)
    return 0
