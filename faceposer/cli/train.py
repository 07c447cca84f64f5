"""``faceposer train``: creates a character from a rig, example meshes or the motion of markers."""

import argparse
from pathlib import Path
from typing import Any

from faceposer.cli.arguments import number, output_path, whole_number
from faceposer.cli.progress_line import ProgressLine
from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.files.atomic import check_not_input, check_output
from faceposer.model.character_names import checked_short_name

NAME = "train"


def add_parser(commands: Any) -> None:
    """Add the parser of ``train`` to ``commands``."""
    parser = commands.add_parser(
        NAME,
        help="create a custom character from a rig, example meshes or markers",
        description="Learn a character from a rig, from example meshes or from the motion of markers, and write it as "
        "one character file (docs/training.md).",
    )
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument(
        "--rig", type=Path, metavar="FILE|DIR", help="glTF file (.glb, .gltf, .vrm) or folder with ARKit shapes"
    )
    source.add_argument("--examples", type=Path, metavar="DIR|NPZ", help="example meshes of the same topology")
    source.add_argument(
        "--markers", type=Path, metavar="FILE", help="motion of markers on a performer's face (.c3d, .csv, .trc)"
    )
    parser.add_argument("-o", "--output", type=output_path, metavar="OUT.npz", required=True, help="character to write")
    parser.add_argument(
        "--capture",
        type=Path,
        metavar="FILE",
        nargs="+",
        action="extend",
        default=[],
        help="performances (.csv, .txt, .json, .glb) from which the prior of a rig is learned",
    )
    parser.add_argument("--neutral", type=Path, metavar="MESH", help="neutral mesh (default: found by its name)")
    parser.add_argument(
        "--align-shapes",
        choices=("auto", "off"),
        default="auto",
        help="lay shapes of a rig that are moved, scaled, turned or mirrored on the neutral face, and correct the unit "
        "of displacements; off: read them as they are stored (default: auto)",
    )
    parser.add_argument(
        "--weights-range",
        type=number,
        choices=(1.0, 100.0),
        metavar="1|100",
        help="full weight of the expressions of a VRM avatar (default: by its version and largest weight)",
    )
    parser.add_argument(
        "--sides",
        choices=("auto", "as-named", "exchanged"),
        default="auto",
        help="left and right in the names of a rig's shapes: exchanged where they move the other side of the face, as "
        "named from the viewer's side; always as they are named; or always exchanged (default: auto)",
    )
    parser.add_argument("--marker-map", type=Path, metavar="JSON", help="place of each marker on the scan")
    parser.add_argument(
        "--scan", metavar="MESH|CHARACTER", default="man", help="face that the markers move (default: man)"
    )
    parser.add_argument(
        "--regions",
        type=_regions,
        metavar="face|whole|N",
        default="face",
        help="regions of examples with separate modes: those of a face, the whole mesh as one, or N clusters of "
        "vertices that move together (default: face)",
    )
    parser.add_argument(
        "--dimensions", type=_count, metavar="N", help="total number of modes of examples (default: by energy)"
    )
    parser.add_argument(
        "--components", type=_count, metavar="K", help="number of factor analyzers (default: by cross-validation)"
    )
    parser.add_argument(
        "--factors", type=_count, metavar="Q", help="factors of each analyzer (default: by cross-validation)"
    )
    parser.add_argument("--scheduler", metavar="ADDRESS", help="Dask scheduler for learning from many examples")
    parser.add_argument("--name", help="short name (default: from the output file)")
    parser.add_argument("--title", help="display name (default: from the name)")
    parser.add_argument("--credits", default="", help="origin and licence of the character")
    parser.add_argument(
        "--summary",
        type=output_path,
        metavar="DIR",
        help="also write a summary of the training as summary.json and .png",
    )


def _count(text: str) -> int:
    count = whole_number(text, 1, 500)
    if count is None:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number from 1 to 500")
    return count


def _regions(text: str) -> str | int:
    if text in ("face", "whole"):
        return text
    count = whole_number(text, 2, 12)
    if count is None:
        raise argparse.ArgumentTypeError(f"'{text}' is not 'face', 'whole' or a number from 2 to 12")
    return count


def run(options: argparse.Namespace) -> int:
    """Learn the character, write it and return the exit status."""
    check_output(options.output, ".npz")
    check_not_input(options.output, options.examples, options.scan)
    if options.name is not None:
        checked_short_name(options.name, "--name")
    if options.summary is not None and paths.exists(options.summary) and not paths.is_dir(options.summary):
        raise FacePoserError(f"'{options.summary}' is a file; give a folder for the summary.")
    from faceposer.model.character_file import save_character
    from faceposer.training.request import TrainingRequest, plain_name, train
    from faceposer.training.summary import check_summary, text_of_summary, write_summary

    if options.summary is not None:
        check_summary(options.summary, has_plots=options.rig is None)

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
        align_shapes=options.align_shapes == "auto",
        weights_range=options.weights_range,
        sides=options.sides,
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
