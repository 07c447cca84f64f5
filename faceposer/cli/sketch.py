"""``faceposer sketch``: poses a face by drawn features."""

import argparse
import json
import time
from pathlib import Path
from typing import Any

from faceposer.cli.arguments import add_spread
from faceposer.cli.progress_line import ProgressLine
from faceposer.errors import article, printable
from faceposer.files.atomic import check_distinct, check_not_input, check_output, write_text

NAME = "sketch"


def add_parser(commands: Any) -> None:
    """Add the parser of ``sketch`` to ``commands``."""
    parser = commands.add_parser(
        NAME,
        help="pose a face by drawn features",
        description="Recognise the features that strokes depict, give the face their shapes and write the session.",
    )
    parser.add_argument("what", metavar="CHARACTER|SESSION", help="character, or session to add the strokes to")
    parser.add_argument("strokes", type=Path, metavar="STROKES", help="file of strokes (docs/sketching-files.md)")
    parser.add_argument("-o", "--output", type=Path, metavar="SESSION.json", required=True, help="session to write")
    parser.add_argument(
        "--camera", type=Path, metavar="JSON", help="camera of the strokes, in place of that of their file"
    )
    parser.add_argument(
        "--method",
        choices=("map", "paper"),
        help="from points to a face: constraints of the solve with the prior, or the statistical mapping of the paper "
        "(default: that of the session, else map)",
    )
    parser.add_argument(
        "--recognition", choices=("ours", "paper"), help="method that recognises features (default: ours)"
    )
    add_spread(parser, "that of the session, else 0.5")
    parser.add_argument("--report", type=Path, metavar="R.json", help="also write features, points and probabilities")


def run(options: argparse.Namespace) -> int:
    """Recognise the strokes, pose the face, write the session and return the exit status."""
    check_output(options.output, ".json")
    # The output may be the input session, which then gains the sketches.
    check_not_input(options.output, options.strokes, options.camera)
    if options.report is not None:
        check_output(options.report, ".json")
        check_not_input(options.report, options.what, options.strokes, options.camera)
        check_distinct(options.report, options.output)
    from faceposer.cli.opening import open_with_remark
    from faceposer.session.report import sketch_report
    from faceposer.session.sketch_strokes import add_strokes
    from faceposer.sketch.strokes_file import read_strokes
    from faceposer.solve.camera_io import read_camera

    session = open_with_remark(options.what)
    character = session.model.character
    camera = None if options.camera is None else read_camera(options.camera, character, of_face=True)
    strokes = read_strokes(options.strokes, character, camera)
    if options.spread is not None:
        session.set_spread(options.spread)
    if options.method is not None:
        session.set_sketch_method(options.method)
    session.wait()
    line = ProgressLine()
    began = time.perf_counter()
    try:
        recognised = add_strokes(session, strokes, options.recognition, line.progress)
    finally:
        line.clear()
    seconds = time.perf_counter() - began
    session.save(options.output, strokes[-1].camera)
    if options.report is not None:
        write_text(options.report, json.dumps(sketch_report(strokes, recognised, seconds), indent=1) + "\n", "report")
    for i, (stroke, found) in enumerate(zip(strokes, recognised, strict=True)):
        print(printable(f"stroke {i}: {_described(found, stroke.feature)}"))
    count = sum(found.best is not None for found in recognised)
    print(f"{options.output} written: {count} of {len(strokes)} strokes recognised, {seconds:.1f} s")
    return 0


def _described(found: Any, named: str | None) -> str:
    """Return a phrase for the recognition ``found`` of a stroke that is ``named``, if at all."""
    best, other = found.best, found.runner_up
    if best is None and named is not None:
        why = found.reason or "it does not match its feature points"
        return f"cannot be {article(named)} {named}: {why}"
    if best is None and found.reason:
        return f"no feature recognised: {found.reason}"
    if best is None:
        return "no feature recognised" + (f" (most like {other.feature})" if other is not None else "")
    rest = f", else {other.feature}" if other is not None else ""
    return f"{best.feature} ({100.0 * best.probability:.0f} %{rest}), {len(best.points)} points"
