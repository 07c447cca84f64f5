"""The commands for what a pose is for, one a file: each has ``NAME``, ``add_parser`` and ``run``."""

import argparse
from collections.abc import Callable
from typing import Any, Protocol

from faceposer.cli_applications import photo

Subparsers = Any


class _Command(Protocol):
    """A command's module.

    Attributes:
        NAME: What is typed.
        add_parser: Adds its parser.
        run: Does what the options ask for and returns the exit status.
    """

    NAME: str
    add_parser: Callable[[Subparsers], None]
    run: Callable[[argparse.Namespace], int]


_COMMANDS: tuple[_Command, ...] = (photo,)

COMMANDS = tuple(command.NAME for command in _COMMANDS)


def add_parsers(commands: Subparsers) -> None:
    """Add the parsers of all these commands to ``commands``."""
    for command in _COMMANDS:
        command.add_parser(commands)


def run(options: argparse.Namespace) -> int:
    """Run what ``options`` ask for and return the exit status."""
    return next(command for command in _COMMANDS if options.command == command.NAME).run(options)
