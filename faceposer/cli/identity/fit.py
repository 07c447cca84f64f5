"""``faceposer identity fit``: makes a character of scans of a head."""

import argparse
from pathlib import Path
from typing import Any

from faceposer.cli.arguments import output_path
from faceposer.cli.identity.heads import ROOM, check_titles
from faceposer.errors import FacePoserError, counted
from faceposer.files.atomic import check_distinct, check_not_input, check_output, check_space

NAME = "fit"


def add_parser(subcommands: Any) -> None:
    """Add the parser of ``fit`` to ``subcommands``."""
    parser = subcommands.add_parser(
        NAME,
        help="make a character of scans of a head",
        description="Make a character of one or more scans of a person's head (docs/identity.md).",
    )
    parser.add_argument("scans", nargs="+", metavar="SCAN", help="mesh of a head, in any unit and orientation")
    parser.add_argument(
        "-o", "--output", type=output_path, required=True, metavar="CHARACTER.npz", help="write the character"
    )
    parser.add_argument(
        "--landmarks",
        action="append",
        default=[],
        metavar="POINTS.json",
        help="landmarks of the scan from 'faceposer landmarks', edited or not; once per scan, in their order",
    )
    parser.add_argument("--report", type=output_path, metavar="R.json", help="write what was measured")
    parser.add_argument(
        "--distance-map", type=output_path, metavar="OUT.png", help="draw the scans, the head, and their distance"
    )
    parser.add_argument("--model", type=Path, metavar="MODEL.npz", help="a model from 'faceposer identity learn'")
    parser.add_argument("--no-detail", dest="detail", action="store_false", help="keep to the model")
    parser.add_argument("--no-texture", dest="texture", action="store_false", help="leave the colours of the scans")
    parser.add_argument("--name", help="short name of the character; that of the output if not given")
    parser.add_argument("--title", help="display name of the character; its short name if not given")


def run(options: argparse.Namespace) -> int:
    """Fit the head, write what is asked for and return the exit status."""
    from faceposer.geometry.mesh_companions import check_not_of_meshes

    outputs = ((options.output, ".npz"), (options.report, ".json"), (options.distance_map, ".png"))
    for path, suffix in outputs:
        if path is not None:
            check_output(path, suffix)
            check_space(path, ROOM[suffix])
            check_not_input(path, *options.landmarks, options.model)
            check_not_of_meshes(path, *options.scans)
    check_distinct(*(path for path, _ in outputs))
    check_titles(options)
    if len(options.landmarks) not in (0, len(options.scans)):
        raise FacePoserError(
            f"--landmarks is given for {len(options.landmarks)} of "
            f"{counted(len(options.scans), 'scan')}; give it once for each scan, or leave it out."
        )
    from faceposer.cli.opening import print_notes
    from faceposer.cli.progress_line import ProgressLine
    from faceposer.files.writing import write_json
    from faceposer.identity.model_file import load_identity_model
    from faceposer.identity.scans.basis import basis_of
    from faceposer.identity.scans.head_from_scans import doubts, head_from_scans, read_scan, shipped_basis
    from faceposer.identity.scans.landmarks_file import read_scan_landmarks
    from faceposer.identity.scans.pictures import distance_map
    from faceposer.identity.scans.scanned_character import scanned_character
    from faceposer.landmarks.overlay import write_picture
    from faceposer.model.character_file import save_character

    marked = [read_scan_landmarks(Path(path)) for path in options.landmarks]
    scans = [read_scan(path, marked[number] if marked else None) for number, path in enumerate(options.scans)]
    line = ProgressLine()
    try:
        model = None if options.model is None else load_identity_model(options.model)
        basis = shipped_basis() if model is None else basis_of(model)
        made = head_from_scans(scans, options.detail, options.texture, line.progress, basis, model)
    finally:
        line.clear()
    name = options.name or options.output.stem
    save_character(options.output, scanned_character(made, name, options.title or name, model))
    report = made.report
    print(
        f"surface {report['surface_mm_median']:.2f} mm median, {report['surface_mm_mean']:.2f} mm mean, "
        f"{report['used']:.0%} of the face on the scan, {report['seconds']:.0f} s"
    )
    print(f"{options.output} written")
    print_notes(str(options.output), doubts(made))
    if options.report is not None:
        write_json(options.report, report, "report")
        print(f"{options.report} written")
    if options.distance_map is not None:
        import numpy as np

        pictures = [distance_map(basis, scan) for scan in made.scans]
        write_picture(options.distance_map, np.vstack(pictures))
        print(f"{options.distance_map} written")
    return 0
