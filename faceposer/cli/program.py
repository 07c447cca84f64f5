"""The program's entry point and its table of commands.

Heavy modules are imported by the command that needs them, so that help and errors appear at once.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import metadata
from typing import Any, NoReturn, Protocol

from faceposer.cli import (
    animate,
    character,
    characters,
    demo,
    evaluate,
    export,
    photo,
    render,
    solve,
    train,
    transfer,
    window,
)
from faceposer.errors import FacePoserError, NoWindowError


class Command(Protocol):
    """The module of a command.

    Attributes:
        NAME: What is typed.
    """

    NAME: str

    def add_parser(self, commands: Any, /) -> None:
        """Add the command's parser to the subparsers ``commands``."""

    def run(self, options: argparse.Namespace, /) -> int:
        """Do what the options ask for and return the exit status."""
        ...


# Poses, meshes and weights do without these.
_DRAWING = ("moderngl", "glfw", "imgui_bundle")

COMMANDS: tuple[Command, ...] = (
    solve,
    render,
    characters,
    demo,
    train,
    character,
    animate,
    transfer,
    photo,
    export,
    evaluate,
)

#: Earlier names of commands, which scripts may still use.
_RENAMED = {"subject": character.NAME, "subjects": characters.NAME}

_USAGE = """\
examples:
  faceposer                                  open the window with the man
  faceposer woman                            ... with the woman
  faceposer smile.json                       ... with a saved session
  faceposer solve smile.json -o smile.obj    pose without a window
  faceposer render woman -o woman.png        draw without a window
  faceposer characters                       list the characters that come with the program
  faceposer demo -o DIR                      watch the program being used, as files
  faceposer train --rig me.glb -o me.npz     make a character of your own; also --examples, --markers
  faceposer character info me.npz            say what is in a character file; also check, rename
  faceposer export smile.json -o smile.glb   to other programs and back: meshes, weights, pictures, films
  faceposer animate man lips.csv --camera camera.json -o lips.json
                                             let the face follow trajectories of a few points
  faceposer transfer smile.json woman -o her-smile.json
                                             carry an expression or an animation to another face
  faceposer photo woman face.jpg --pins pins.json -o face.json
                                             pose after a photo
  faceposer evaluate -o DIR                  how near the prior and its rivals come to unseen expressions

'faceposer COMMAND --help' tells more of a command."""


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one sentence, without the usage before it."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{message[:1].upper()}{message[1:]}; see '{self.prog} --help'.\n")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line ``arguments``, those of the process if None, and exit with its status."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    # The matrices are small: threads of NumPy's own would only take time from the frames and the solver.
    for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    try:
        status = _run(words)
    except FacePoserError as error:
        print(error, file=sys.stderr)
        # A status of its own, by which scripts/run knows to play the demo instead.
        status = 3 if isinstance(error, NoWindowError) else 2
    except ModuleNotFoundError as error:
        if error.name is None or error.name.split(".")[0] not in _DRAWING:
            raise
        print(
            f"Drawing needs the package '{error.name}', which is not installed: pip install faceposer.", file=sys.stderr
        )
        status = 2
    except KeyboardInterrupt:
        status = 130
    except BrokenPipeError:
        status = 141
    sys.exit(status)


def _run(words: list[str]) -> int:
    if words and words[0] in _RENAMED:
        words = [_RENAMED[words[0]], *words[1:]]
    command = next((command for command in COMMANDS if words and words[0] == command.NAME), None)
    if command is None:
        return window.run(_window_parser().parse_args(words))
    options = _command_parser().parse_args(words)
    options.words = words
    return command.run(options)


def _version() -> str:
    try:
        return f"Face Poser {metadata.version('faceposer')}"
    except metadata.PackageNotFoundError:
        return "Face Poser, not installed"


def _window_parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="faceposer",
        description="Pose a 3D face by dragging it: the whole face follows as a real face would.",
        epilog=_USAGE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    window.add_arguments(parser)
    parser.add_argument("--version", action="version", version=_version())
    return parser


def _command_parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="faceposer")
    commands = parser.add_subparsers(dest="command", required=True)
    for command in COMMANDS:
        command.add_parser(commands)
    return parser
