"""Heads that the subcommands read, and options that several of them share."""

import argparse
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from faceposer.cli.arguments import number, number_between, output_path
from faceposer.errors import FacePoserError
from faceposer.files.atomic import check_not_input, check_output
from faceposer.model.character_names import checked_short_name, checked_title, is_installed

if TYPE_CHECKING:
    from faceposer.identity.editing import HeadEditor
    from faceposer.identity.identity import Identity

#: Help for the argument that names a head.
HEAD_HELP = "name of a character, character file (.npz) or session (.json)"

#: Bytes that outputs take at most, by suffix.
ROOM = {".npz": 32 << 20, ".json": 1 << 20, ".png": 4 << 20}


@dataclass(frozen=True, eq=False)
class OpenedHead:
    """A head from a file.

    Attributes:
        editor: Editor of the character's head.
        identity: The head: that of the session, or of the character.
    """

    editor: "HeadEditor"
    identity: "Identity"

    @property
    def title(self) -> str:
        """Display name of the character."""
        return self.editor.character.title


def opened_head(what: str) -> OpenedHead:
    """Return the head of the character or session ``what``.

    Raises:
        FacePoserError: If it cannot be read, or its head cannot be edited.
    """
    from faceposer.geometry.mesh_io import MESH_SUFFIXES
    from faceposer.identity.editing import head_editor
    from faceposer.model.character_file import load_character

    if Path(what).suffix.lower() in MESH_SUFFIXES:
        raise FacePoserError(
            f"'{what}' is a mesh, not a character; make a character of a scan with 'faceposer identity fit'."
        )
    if Path(what).suffix.lower() != ".json":
        editor = head_editor(load_character(what))
        return OpenedHead(editor, editor.own)
    from faceposer.cli.opening import open_with_remark

    session = open_with_remark(what)
    editor = head_editor(session.base_model.character)
    return OpenedHead(editor, session.document.identity or editor.own)


def add_output_options(parser: argparse.ArgumentParser) -> None:
    """Add the output file and the names of the character to ``parser``."""
    parser.add_argument(
        "-o", "--output", type=output_path, required=True, metavar="CHARACTER.npz", help="write the character"
    )
    parser.add_argument("--name", help="short name of the character; that of the output if not given")
    parser.add_argument("--title", help="display name of the character; its short name if not given")


def add_shape_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that change a head to ``parser``: caricature and skin."""
    parser.add_argument(
        "--caricature",
        type=lambda text: number_between(text, 0.0, 2.5),
        default=1.0,
        metavar="F",
        help="multiply the deviation from the average before attributes are set: 0 is the average, 1 the head itself, "
        "2.5 grotesque",
    )
    parser.add_argument(
        "--texture",
        metavar="SKIN",
        help="'random' for a skin that fits age and gender, 'own' for that of the character, or a skin by name, such "
        "as old-dark-male",
    )
    parser.add_argument(
        "--tone",
        type=lambda text: number_between(text, -2.5, 2.5),
        metavar="T",
        help="tone of the skin, from -2.5 (light) to 2.5 (dark)",
    )


def check_names(options: argparse.Namespace, *inputs: str) -> None:
    """Check the output and the names of the character that ``options`` ask for, before anything is read.

    Raises:
        FacePoserError: If the output cannot be written or is one of the ``inputs``, or if a name is not possible.
    """
    check_output(options.output, ".npz")
    check_not_input(options.output, *inputs)
    check_titles(options)


def check_titles(options: argparse.Namespace) -> None:
    """Check the names of the character that ``options`` ask for.

    Raises:
        FacePoserError: If a name is not possible, or if that of the file is the name of an installed character.
    """
    if options.name is not None:
        checked_short_name(options.name, "--name")
    elif is_installed(name := options.output.stem.strip()):
        raise FacePoserError(
            f"The character in '{options.output}' would be called '{name}', as a built-in one; name the file "
            "otherwise, or give another name with --name."
        )
    if options.title is not None:
        checked_title(options.title, "--title")


def values_of(pairs: list[str], label: str) -> dict[str, float]:
    """Return the numbers in ``pairs`` of the form NAME=VALUE by name; ``label`` begins the message of an error.

    Raises:
        FacePoserError: If a pair has another form, or a name is given twice.
    """
    values: dict[str, float] = {}
    for pair in pairs:
        name, equals, text = pair.partition("=")
        value = number(text)
        if not (name and equals) or math.isnan(value):
            raise FacePoserError(f"{label} '{pair}' must have the form NAME=NUMBER, such as age=0.5.")
        if name in values:
            raise FacePoserError(f"{label} gives '{name}' twice; give one value.")
        values[name] = value
    return values


def changed_head(options: argparse.Namespace, head: OpenedHead, values: dict[str, float], seed: int = 0) -> "Identity":
    """Return ``head`` with the caricature and skin of ``options`` and the attributes ``values``.

    Raises:
        FacePoserError: If an attribute or the skin does not exist, or a value is out of range.
    """
    from faceposer.identity import head_choices

    return head_choices.changed_head(
        head.editor, head.identity, options.caricature, values, options.texture, options.tone, seed
    )


def write_head(options: argparse.Namespace, editor: "HeadEditor", identity: "Identity") -> None:
    """Write the character with the head ``identity``, and print what it is.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    from faceposer.identity.editing import head_editor
    from faceposer.identity.head_choices import named_character
    from faceposer.model.character_file import save_character

    name = (options.name or options.output.stem).strip()
    character = named_character(editor, identity, name, (options.title or name).strip())
    save_character(options.output, character)
    # The distance that 'identity info' finds in the file: the vertices know the head only as far as the modes reach.
    written = head_editor(character)
    print(f"{options.output} written: distance from the average {written.distance(written.own):.2f} (people: about 1)")
