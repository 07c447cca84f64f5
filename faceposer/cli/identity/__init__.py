"""``faceposer identity``: heads of the morphable model; one module per subcommand."""

import argparse
from typing import Any, Protocol

from faceposer.cli.identity import fit, fit_photo, info, learn, mix, new, set_attributes

NAME = "identity"


class Subcommand(Protocol):
    """Interface of a subcommand's module.

    Attributes:
        NAME: Name of the subcommand.
    """

    NAME: str

    def add_parser(self, subcommands: Any, /) -> None:
        """Add the parser of the subcommand to ``subcommands``."""

    def run(self, options: argparse.Namespace, /) -> int:
        """Run the subcommand with the parsed ``options`` and return the exit status."""
        ...


SUBCOMMANDS: tuple[Subcommand, ...] = (new, set_attributes, mix, fit, fit_photo, learn, info)


def add_parser(commands: Any) -> None:
    """Add the parser of ``identity`` to ``commands``."""
    parser = commands.add_parser(
        NAME,
        help="make characters of any head",
        description="Make characters of any head with a morphable model (docs/identity.md).",
    )
    subcommands = parser.add_subparsers(dest="action", required=True)
    for subcommand in SUBCOMMANDS:
        subcommand.add_parser(subcommands)


def run(options: argparse.Namespace) -> int:
    """Run the chosen subcommand and return the exit status."""
    return next(subcommand for subcommand in SUBCOMMANDS if options.action == subcommand.NAME).run(options)
