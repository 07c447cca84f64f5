"""``faceposer subjects``: lists the characters that come with the program."""

import argparse
from typing import Any

NAME = "subjects"


def add_parser(commands: Any) -> None:
    """Add the parser of ``subjects`` to ``commands``."""
    commands.add_parser(NAME, help="list the faces", description="List the faces that come with the program.")


def run(_options: argparse.Namespace) -> int:
    """Print names and titles and return the exit status."""
    from faceposer.model.subject_file import available_subjects

    subjects = available_subjects()
    width = max((len(name) for name, _ in subjects), default=0)
    for name, title in subjects:
        print(f"{name:{width}}  {title}")
    return 0
