"""The commands for what a pose is for, one a file: each has ``NAME``, ``add_parser`` and ``run``."""

import argparse
from typing import Any, Protocol

from faceposer.cli_applications import animate, export, photo, transfer

Subparsers = Any


class _Command(Protocol):
    """A command's module.

    Attributes:
        NAME: What is typed.
    """

    NAME: str

    def add_parser(self, commands: Subparsers, /) -> None:
        """Add its parser."""

    def run(self, options: argparse.Namespace, /) -> int:
        """Do what the options ask for and return the exit status."""
        ...


_COMMANDS: tuple[_Command, ...] = (animate, transfer, photo, export)

COMMANDS = tuple(command.NAME for command in _COMMANDS)


def add_parsers(commands: Subparsers) -> None:
    """Add the parsers of all these commands to ``commands``."""
    for command in _COMMANDS:
        command.add_parser(commands)


def run(options: argparse.Namespace) -> int:
    """Run what ``options`` ask for and return the exit status."""
    return next(command for command in _COMMANDS if options.command == command.NAME).run(options)
