"""``faceposer character``: shows, checks or renames a character's file."""

import argparse
import json
from pathlib import Path
from typing import Any

from faceposer.errors import FacePoserError

NAME = "character"


def add_parser(commands: Any) -> None:
    """Add the parser of ``character`` to ``commands``."""
    character = commands.add_parser(
        NAME, help="show, check or rename a character file", description="Look after a character file."
    )
    actions = character.add_subparsers(dest="action", required=True)
    info = actions.add_parser("info", help="say what is in it", description="Say what is in a character file.")
    info.add_argument("--json", action="store_true", help="as JSON")
    check = actions.add_parser(
        "check", help="find what is wrong with it", description="Check a character file, and whether it can be posed."
    )
    rename = actions.add_parser(
        "rename",
        help="change its names",
        description="Change the name, the title, the credits or names of shapes of a character file.",
    )
    rename.add_argument("--name", help="short name")
    rename.add_argument("--title", help="name to show")
    rename.add_argument("--credits", help="where it comes from, and its licence")
    rename.add_argument("--shape", metavar="OLD=NEW", nargs="+", default=[], help="names of shapes")
    for action in (info, check, rename):
        action.add_argument("file", metavar="CHARACTER", help="character file (.npz), or the name of a character")


def run(options: argparse.Namespace) -> int:
    """Do what the options ask for and return the exit status."""
    return {"info": _info, "check": _check, "rename": _rename}[options.action](options)


def _info(options: argparse.Namespace) -> int:
    from faceposer.model.character_file import load_character
    from faceposer.training.summary import description_of, text_of_summary

    character = load_character(options.file)
    if options.json:
        print(json.dumps(description_of(character), indent=1, ensure_ascii=False))
    else:
        print(text_of_summary(character))
    return 0


def _check(options: argparse.Namespace) -> int:
    from faceposer.model.character_file import load_character
    from faceposer.model.face_model import build_face_model
    from faceposer.training.summary import findings_of

    character = load_character(options.file)
    findings = findings_of(character, build_face_model(character))
    for finding in findings:
        print(finding)
    print(f"'{options.file}' is sound and can be posed{'; see above for what could be better' if findings else ''}.")
    return 0


def _rename(options: argparse.Namespace) -> int:
    from faceposer.model.character_file import load_character, save_character
    from faceposer.training.renaming import renamed

    path = Path(options.file)
    if path.suffix.lower() != ".npz":
        raise FacePoserError(f"'{options.file}' is no character file; give the path of one, which ends in .npz.")
    pairs = {}
    for pair in options.shape:
        old, equals, new = pair.partition("=")
        if not (old and equals and new):
            raise FacePoserError(f"'{pair}' does not say how to rename a shape; write OLD=NEW.")
        pairs[old] = new
    if not (pairs or options.name or options.title or options.credits is not None):
        raise FacePoserError("Nothing is to be renamed; give --name, --title, --credits or --shape OLD=NEW.")
    character = renamed(load_character(path), f"'{path}'", options.name, options.title, options.credits, pairs)
    save_character(path, character)
    print(f"{path} written")
    return 0
