"""``faceposer characters``: lists the characters that come with the program."""

import argparse
from typing import Any

NAME = "characters"


def add_parser(commands: Any) -> None:
    """Add the parser of ``characters`` to ``commands``."""
    commands.add_parser(NAME, help="list the characters", description="List the characters that come with the program.")


def run(_options: argparse.Namespace) -> int:
    """Print the name and the title of each character and return the exit status."""
    from faceposer.model.character_file import available_characters

    characters = available_characters()
    width = max((len(name) for name, _ in characters), default=0)
    for name, title in characters:
        print(f"{name:{width}}  {title}")
    return 0
