"""``faceposer train``: makes a character from a rig, example meshes or the motion of markers."""

import argparse
from pathlib import Path
from typing import Any

from faceposer.cli.progress_line import ProgressLine
from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.files.atomic import check_apart, check_output

NAME = "train"


def add_parser(commands: Any) -> None:
    """Add the parser of ``train`` to ``commands``."""
    parser = commands.add_parser(
        NAME,
        help="make a character of your own from a rig, example meshes or markers",
        description="Learn a character from a rig, from example meshes or from the motion of markers "
        "(docs/training.md), and write it as one character file.",
    )
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument(
        "--rig", type=Path, metavar="FILE|DIR", help="glTF (.glb, .gltf, .vrm) or folder with ARKit's shapes"
    )
    source.add_argument("--examples", type=Path, metavar="DIR|NPZ", help="meshes of one topology")
    source.add_argument("--markers", type=Path, metavar="C3D|CSV", help="motion of markers on a performer's face")
    parser.add_argument("-o", "--output", type=Path, metavar="OUT.npz", required=True, help="character to write")
    parser.add_argument(
        "--capture",
        type=Path,
        metavar="CSV",
        nargs="+",
        default=[],
        help="performances to learn the prior of a rig from",
    )
    parser.add_argument("--neutral", type=Path, metavar="MESH", help="neutral mesh, if its name does not say so")
    parser.add_argument("--marker-map", type=Path, metavar="JSON", help="where on the scan each marker is")
    parser.add_argument("--scan", metavar="MESH|CHARACTER", default="man", help="what markers move (default: man)")
    parser.add_argument(
        "--regions",
        type=_regions,
        metavar="face|whole|N",
        default="face",
        help="regions of examples with modes of their own: of a face, one, or N found by what moves together",
    )
    parser.add_argument("--dimensions", type=_count, metavar="N", help="modes of examples in all (default: by energy)")
    parser.add_argument("--components", type=_count, metavar="K", help="factor analyzers (default: by data left out)")
    parser.add_argument("--factors", type=_count, metavar="Q", help="factors of each (default: by data left out)")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="Dask scheduler to learn from many examples with")
    parser.add_argument("--name", help="short name (default: that of the output)")
    parser.add_argument("--title", help="name to show (default: from the name)")
    parser.add_argument("--credits", default="", help="where the character comes from, and its licence")
    parser.add_argument("--summary", type=Path, metavar="DIR", help="write what was learned as summary.json and .png")


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


def run(options: argparse.Namespace) -> int:
    """Learn the character, write it and return the exit status."""
    check_output(options.output, ".npz")
    check_apart(options.output, options.examples, options.scan)
    if options.summary is not None and paths.exists(options.summary) and not paths.is_dir(options.summary):
        raise FacePoserError(f"'{options.summary}' is a file; give a folder for the summary.")
    from faceposer.model.character_file import save_character
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
    line = ProgressLine()
    try:
        character = train(request, line.progress)
    finally:
        line.clear()
    save_character(options.output, character)
    if options.summary is not None:
        write_summary(options.summary, character)
    print(text_of_summary(character))
    print(f"{options.output} written; open it with: faceposer {options.output}")
    return 0
