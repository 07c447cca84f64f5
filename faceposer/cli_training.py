"""The commands that make characters and look after their files: ``train`` and ``subject``."""

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from faceposer.errors import FacePoserError
from faceposer.interchange.files import check_apart, check_output

COMMANDS = ("train", "subject")

Subparsers = Any
Run = Callable[[argparse.Namespace], int]


def add_parsers(commands: Subparsers) -> None:
    """Add the parsers of ``train`` and ``subject`` to ``commands``."""
    _add_train(commands)
    _add_subject(commands)


def run(options: argparse.Namespace) -> int:
    """Run what ``options`` ask for and return the exit status."""
    return _train(options) if options.command == "train" else _subject(options)


def _add_train(commands: Subparsers) -> None:
    train = commands.add_parser(
        "train",
        help="make a character of your own from a rig, example meshes or markers",
        description="Learn a character from a rig, from example meshes or from the motion of markers "
        "(docs/training.md), and write it as one subject file.",
    )
    source = train.add_mutually_exclusive_group(required=True)
    source.add_argument(
        "--rig", type=Path, metavar="FILE|DIR", help="glTF (.glb, .gltf, .vrm) or folder with ARKit's shapes"
    )
    source.add_argument("--examples", type=Path, metavar="DIR|NPZ", help="meshes of one topology")
    source.add_argument("--markers", type=Path, metavar="C3D|CSV", help="motion of markers on a performer's face")
    train.add_argument("-o", "--output", type=Path, metavar="OUT.npz", required=True, help="subject to write")
    train.add_argument(
        "--capture",
        type=Path,
        metavar="CSV",
        nargs="+",
        default=[],
        help="performances to learn the prior of a rig from",
    )
    train.add_argument("--neutral", type=Path, metavar="MESH", help="neutral mesh, if its name does not say so")
    train.add_argument("--marker-map", type=Path, metavar="JSON", help="where on the scan each marker is")
    train.add_argument("--scan", metavar="MESH|SUBJECT", default="man", help="what markers move (default: man)")
    train.add_argument(
        "--regions",
        type=_regions,
        metavar="face|whole|N",
        default="face",
        help="regions of examples with modes of their own: of a face, one, or N found by what moves together",
    )
    train.add_argument("--dimensions", type=_count, metavar="N", help="modes of examples in all (default: by energy)")
    train.add_argument("--components", type=_count, metavar="K", help="factor analyzers (default: by data left out)")
    train.add_argument("--factors", type=_count, metavar="Q", help="factors of each (default: by data left out)")
    train.add_argument("--scheduler", metavar="ADDRESS", help="Dask scheduler to learn from many examples with")
    train.add_argument("--name", help="short name (default: that of the output)")
    train.add_argument("--title", help="name to show (default: from the name)")
    train.add_argument("--credits", default="", help="where the character comes from, and its licence")
    train.add_argument("--summary", type=Path, metavar="DIR", help="write what was learned as summary.json and .png")


def _add_subject(commands: Subparsers) -> None:
    subject = commands.add_parser(
        "subject", help="show, check or rename a subject file", description="Look after a subject file."
    )
    actions = subject.add_subparsers(dest="action", required=True)
    info = actions.add_parser("info", help="say what is in it", description="Say what is in a subject file.")
    info.add_argument("--json", action="store_true", help="as JSON")
    check = actions.add_parser(
        "check", help="find what is wrong with it", description="Check a subject file, and whether it can be posed."
    )
    rename = actions.add_parser(
        "rename",
        help="change its names",
        description="Change the name, the title, the credits or names of shapes of a subject file.",
    )
    rename.add_argument("--name", help="short name")
    rename.add_argument("--title", help="name to show")
    rename.add_argument("--credits", help="where it comes from, and its licence")
    rename.add_argument("--shape", metavar="OLD=NEW", nargs="+", default=[], help="names of shapes")
    for action in (info, check, rename):
        action.add_argument("file", metavar="SUBJECT", help="subject file (.npz), or the name of a subject")


def _count(text: str) -> int:
    if not text.isdigit() or not 1 <= int(text) <= 500:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number from 1 to 500")
    return int(text)


def _regions(text: str) -> str | int:
    if text in ("face", "whole"):
        return text
    if not text.isdigit() or not 2 <= int(text) <= 12:
        raise argparse.ArgumentTypeError(f"'{text}' is neither 'face' nor 'whole' nor a number from 2 to 12")
    return int(text)


def _train(options: argparse.Namespace) -> int:
    check_output(options.output, ".npz")
    check_apart(options.output, options.examples, options.scan)
    if options.summary is not None and options.summary.exists() and not options.summary.is_dir():
        raise FacePoserError(f"'{options.summary}' is a file; give a folder for the summary.")
    from faceposer.model.subject_file import save_subject
    from faceposer.training.progress import Progress
    from faceposer.training.request import TrainingRequest, plain_name, train
    from faceposer.training.summary import text_of_summary, write_summary

    kind = next(kind for kind in ("rig", "examples", "markers") if getattr(options, kind) is not None)
    name = options.name or plain_name(options.output)
    request = TrainingRequest(
        kind=kind,  # type: ignore[arg-type]
        source=getattr(options, kind),
        name=name,
        title=options.title or name.replace("-", " ").capitalize(),
        captures=tuple(options.capture),
        neutral=options.neutral,
        marker_map=options.marker_map,
        scan=options.scan,
        segments=options.regions,
        n_dimensions=options.dimensions,
        n_components=options.components,
        n_factors=options.factors,
        scheduler=options.scheduler,
        credits=options.credits,
    )
    line = _ProgressLine()
    try:
        subject = train(request, Progress(line.show))
    finally:
        line.clear()
    save_subject(options.output, subject)
    if options.summary is not None:
        write_summary(options.summary, subject)
    print(text_of_summary(subject))
    print(f"{options.output} written; open it with: faceposer {options.output}")
    return 0


class _ProgressLine:
    """One line that says how far the training is, where somebody is looking."""

    def __init__(self) -> None:
        self._shown = ""
        self._wanted = sys.stderr.isatty()

    def show(self, stage: str, share: float) -> None:
        text = f"{stage} {100 * share:3.0f} %" if share else stage
        if self._wanted and text != self._shown:
            print(f"\r{text:60}", end="", file=sys.stderr, flush=True)
            self._shown = text

    def clear(self) -> None:
        if self._shown:
            print(f"\r{'':60}\r", end="", file=sys.stderr, flush=True)


def _subject(options: argparse.Namespace) -> int:
    return {"info": _info, "check": _check, "rename": _rename}[options.action](options)


def _info(options: argparse.Namespace) -> int:
    from faceposer.model.subject_file import load_subject
    from faceposer.training.summary import description_of, text_of_summary

    subject = load_subject(options.file)
    if options.json:
        print(json.dumps(description_of(subject), indent=1, ensure_ascii=False))
    else:
        print(text_of_summary(subject))
    return 0


def _check(options: argparse.Namespace) -> int:
    from faceposer.model.face_model import build_face_model
    from faceposer.model.subject_file import load_subject
    from faceposer.training.summary import findings_of

    subject = load_subject(options.file)
    findings = findings_of(subject, build_face_model(subject))
    for finding in findings:
        print(finding)
    print(f"'{options.file}' is sound and can be posed{'; see above for what could be better' if findings else ''}.")
    return 0


def _rename(options: argparse.Namespace) -> int:
    from faceposer.model.subject_file import load_subject, save_subject
    from faceposer.training.renaming import renamed

    path = Path(options.file)
    if path.suffix.lower() != ".npz":
        raise FacePoserError(f"'{options.file}' is no subject file; give the path of one, which ends in .npz.")
    pairs = {}
    for pair in options.shape:
        old, equals, new = pair.partition("=")
        if not (old and equals and new):
            raise FacePoserError(f"'{pair}' does not say how to rename a shape; write OLD=NEW.")
        pairs[old] = new
    if not (pairs or options.name or options.title or options.credits is not None):
        raise FacePoserError("Nothing is to be renamed; give --name, --title, --credits or --shape OLD=NEW.")
    subject = renamed(load_subject(path), f"'{path}'", options.name, options.title, options.credits, pairs)
    save_subject(path, subject)
    print(f"{path} written")
    return 0
