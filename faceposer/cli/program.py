"""Entry point of the program and table of its commands.

Each command imports heavy modules only when it runs, so that help and errors appear at once.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import Any, NoReturn, Protocol

from faceposer.cli import (
    animate,
    character,
    characters,
    demo,
    evaluate,
    export,
    identity,
    keys,
    landmarks,
    photo,
    render,
    sketch,
    solve,
    train,
    transfer,
    window,
)
from faceposer.cli.console import flushed, prepare_console, tell
from faceposer.errors import FacePoserError, NoSessionError, NoWindowError


class Command(Protocol):
    """Interface of a command's module.

    Attributes:
        NAME: Name of the command.
    """

    NAME: str

    def add_parser(self, commands: Any, /) -> None:
        """Add the parser of the command to the subparsers ``commands``."""

    def run(self, options: argparse.Namespace, /) -> int:
        """Run the command with the parsed ``options`` and return the exit status."""
        ...


# Packages that only drawing needs; poses, meshes and weights work without them.
_DRAWING_PACKAGES = ("moderngl", "glfw", "imgui_bundle")

COMMANDS: tuple[Command, ...] = (
    solve,
    render,
    characters,
    demo,
    train,
    character,
    animate,
    transfer,
    keys,
    photo,
    landmarks,
    identity,
    sketch,
    export,
    evaluate,
)

#: Earlier names of commands, kept for existing scripts.
_RENAMED = {"subject": character.NAME, "subjects": characters.NAME}

_USAGE = """\
examples:
  faceposer                                  open the window with the man
  faceposer woman                            ... with the woman
  faceposer smile.json                       ... with a saved session
  faceposer solve smile.json -o smile.obj    solve a pose without a window
  faceposer render woman -o woman.png        render without a window
  faceposer characters                       list the characters that come with the program
  faceposer demo -o DIR                      record a scripted posing session
  faceposer train --rig me.glb -o me.npz     create a custom character; also --examples, --markers
  faceposer character info me.npz            describe a character file; also check, rename
  faceposer export smile.json -o smile.glb   write meshes, weights, images and videos for other programs
  faceposer animate man lips.csv --camera camera.json -o lips.json
                                             animate a face by the trajectories of a few points
  faceposer transfer smile.json woman -o her-smile.json
                                             transfer an expression or an animation to another character
  faceposer keys init man creature -o keys   begin pairs of key poses, by which expressions are transferred
  faceposer photo woman face.jpg --pins pins.json -o face.json
                                             pose a face from a photo
  faceposer landmarks face.jpg -o points.json
                                             find the landmarks of a photo or a mesh
  faceposer identity new --seed 7 -o me.npz  make a character with a random head; also set, mix, info
  faceposer identity fit scan.obj -o me.npz  make a character of a scan of a head
  faceposer sketch man strokes.json -o drawn.json
                                             pose a face by drawn features
  faceposer evaluate -o DIR                  compare the prior with other techniques on unseen expressions

See 'faceposer COMMAND --help' for the options of a command."""


class _Parser(argparse.ArgumentParser):
    """Parser that reports errors in one sentence, without the usage."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{message[:1].upper()}{message[1:]}; see '{self.prog} --help'.\n")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line ``arguments`` (those of the process if None) and exit with its status."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    prepare_console()
    # The matrices are small: threads inside NumPy would only take time from drawing and the solver.
    for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    try:
        status = _run(words)
    except FacePoserError as error:
        tell(_with_remedy(error) if isinstance(error, NoSessionError) else error)
        # scripts/run plays the demo instead when it gets status 3.
        status = 3 if isinstance(error, NoWindowError) else 2
    except ModuleNotFoundError as error:
        if error.name is None or error.name.split(".")[0] not in _DRAWING_PACKAGES:
            raise
        tell(f"Drawing needs the package '{error.name}', which is not installed: pip install faceposer.")
        status = 2
    except KeyboardInterrupt:
        status = 130
    except BrokenPipeError:
        status = 141
    except OSError as error:
        name = "" if error.filename is None else f" '{os.fsdecode(error.filename)}'"
        tell(FacePoserError(f"A file{name} cannot be used: {error.strerror or error}."))
        status = 2
    except MemoryError:
        tell("There is not enough memory; close other programs, or use smaller inputs.")
        status = 2
    sys.exit(flushed(status))


def _with_remedy(error: NoSessionError) -> str:
    from faceposer.cli.remedies import remedy_for

    return f"{error}{remedy_for(Path(error.path))}"


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
        description="Pose a 3D face by dragging it; the rest of the face follows naturally.",
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
