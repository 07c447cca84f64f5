"""``faceposer character``: describes, checks or renames a character file."""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from faceposer.errors import FacePoserError, is_shown, short_name

NAME = "character"


def add_parser(commands: Any) -> None:
    """Add the parser of ``character`` to ``commands``."""
    character = commands.add_parser(
        NAME,
        help="describe, check or rename a character file",
        description="Describe, check or rename a character file.",
    )
    actions = character.add_subparsers(dest="action", required=True)
    info = actions.add_parser(
        "info", help="describe its contents", description="Describe the contents of a character file."
    )
    info.add_argument("--json", action="store_true", help="print JSON")
    check = actions.add_parser(
        "check",
        help="report defects",
        description="Report defects of a character file, and test that the character can be posed.",
    )
    rename = actions.add_parser(
        "rename",
        help="change its names",
        description="Change the name, title, credits or shape names of a character file.",
    )
    rename.add_argument("--name", help="new short name")
    rename.add_argument("--title", help="new display name")
    rename.add_argument("--credits", help="new credits: origin and licence")
    rename.add_argument(
        "--shape", metavar="OLD=NEW", nargs="+", action="extend", default=[], help="new names of shapes"
    )
    for action in (info, check, rename):
        action.add_argument("file", metavar="CHARACTER", help="character file (.npz), or the name of a character")


def run(options: argparse.Namespace) -> int:
    """Run the chosen action and return the exit status."""
    return {"info": _info, "check": _check, "rename": _rename}[options.action](options)


def _info(options: argparse.Namespace) -> int:
    from faceposer.model.character_file import load_character
    from faceposer.training.summary import description_of, text_of_summary

    character = load_character(options.file)
    if options.json:
        # Other encodings than UTF-8 may lack characters, which JSON can escape.
        is_utf8 = (sys.stdout.encoding or "").lower().replace("-", "") == "utf8"
        text = json.dumps(description_of(character), indent=1, ensure_ascii=not is_utf8)
        # Invisible characters, such as those that reverse a text, are escaped as in all other output.
        print("".join(char if char == "\n" or is_shown(char) else json.dumps(char)[1:-1] for char in text))
    else:
        print(text_of_summary(character))
    return 0


def _check(options: argparse.Namespace) -> int:
    from faceposer.model.character_file import load_character
    from faceposer.model.face_model import build_face_model
    from faceposer.training.summary import findings_of

    character = load_character(options.file)
    for name, reason in character.damaged_textures.items():
        raise FacePoserError(
            f"The character file '{options.file}' cannot be used: its texture '{short_name(name)}' is unusable, since "
            f"{reason}; create the character again."
        )
    findings = findings_of(character, build_face_model(character))
    for finding in findings:
        print(finding)
    print(f"'{options.file}' is valid and can be posed{'; see the remarks above' if findings else ''}.")
    return 0


def _rename(options: argparse.Namespace) -> int:
    from faceposer.model.character_file import load_character, save_character
    from faceposer.model.character_names import checked_short_name
    from faceposer.training.renaming import renamed

    path = Path(options.file)
    if path.suffix.lower() != ".npz":
        raise FacePoserError(f"'{options.file}' is not a character file; give the path of a file that ends in .npz.")
    pairs = {}
    for pair in options.shape:
        old, equals, new = pair.partition("=")
        if not (old and equals and new):
            raise FacePoserError(f"--shape '{pair}' must have the form OLD=NEW.")
        pairs[old] = new
    if not (pairs or options.name or options.title or options.credits is not None):
        raise FacePoserError("No new name is given; use --name, --title, --credits or --shape OLD=NEW.")
    if options.name:
        checked_short_name(options.name, "--name")
    character = renamed(load_character(path), f"'{path}'", options.name, options.title, options.credits, pairs)
    save_character(path, character)
    print(f"{path} written")
    return 0
