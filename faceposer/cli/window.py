"""``faceposer [CHARACTER|SESSION]``: opens the window; the only command without a name."""

import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the window to ``parser``."""
    parser.add_argument(
        "what", metavar="CHARACTER or SESSION", nargs="?", default="man", help="character or saved session to open"
    )
    parser.add_argument("--exit-after-first-frame", action="store_true", help=argparse.SUPPRESS)


def run(options: argparse.Namespace) -> int:
    """Open the window and return the exit status once it is closed."""
    from faceposer.gui.app import run as open_window

    return open_window(options.what, exit_after_first_frame=options.exit_after_first_frame)
