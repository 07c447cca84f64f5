"""The command line: one file a command, listed in ``program.py``."""

from faceposer.cli.program import main

__all__ = ["main"]
