"""The option ``--no-contact`` of all commands that write what a face looks like."""

import argparse


def add_contact_option(parser: argparse.ArgumentParser) -> None:
    """Add ``--no-contact`` to ``parser``."""
    parser.add_argument(
        "--no-contact",
        dest="contact",
        action="store_false",
        help="leave out the contact step of meshes and pictures: lids, lips and teeth may lie in each other, as they "
        "may in .glb, .csv and .json in any case, since morph targets and weights cannot contain contact",
    )
