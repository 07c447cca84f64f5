"""``faceposer sketch``: poses a face by drawn features."""

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from faceposer.cli.arguments import add_spread, output_path
from faceposer.cli.progress_line import ProgressLine
from faceposer.errors import FacePoserError, article, printable
from faceposer.files.atomic import check_distinct, check_not_input, check_output

if TYPE_CHECKING:
    from faceposer.session.session import Session

NAME = "sketch"
# Size of the view into which drawings are aligned, in pixels.
_DRAWING_SIZE = (960, 960)


def add_parser(commands: Any) -> None:
    """Add the parser of ``sketch`` to ``commands``."""
    parser = commands.add_parser(
        NAME,
        help="pose a face by drawn features",
        description="Recognise the features that strokes depict, give the face their shapes and write the session.",
    )
    parser.add_argument("what", metavar="CHARACTER|SESSION", help="character, or session to add the strokes to")
    parser.add_argument("strokes", type=Path, metavar="STROKES", help="file of strokes (.json), or drawing (.svg)")
    parser.add_argument(
        "-o", "--output", type=output_path, metavar="SESSION.json", required=True, help="session to write"
    )
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
    parser.add_argument(
        "--relative",
        metavar="auto|off|NEUTRAL.svg",
        help="neutral face by which a drawing is judged: its layer 'neutral' or an assumed one (auto, the default), "
        "none (off: lines are taken as they are), or a drawing of it",
    )
    add_spread(parser, "that of the session, else 0.5")
    parser.add_argument(
        "--report", type=output_path, metavar="R.json", help="also write features, points and probabilities"
    )


def run(options: argparse.Namespace) -> int:
    """Recognise the strokes, pose the face, write the session and return the exit status."""
    check_output(options.output, ".json")
    # The output may be the input session, which then gains the sketches.
    check_not_input(options.output, options.strokes, options.camera)
    if options.report is not None:
        check_output(options.report, ".json")
        check_not_input(options.report, options.what, options.strokes, options.camera)
        check_distinct(options.report, options.output)
    is_drawing = options.strokes.suffix.lower() == ".svg"
    if not is_drawing and options.relative is not None:
        raise FacePoserError("--relative is for drawings (.svg); strokes of a .json file are taken as they are.")
    if is_drawing and options.recognition is not None:
        raise FacePoserError(
            "--recognition is for strokes of a .json file; the lines of a drawing are judged together."
        )
    if is_drawing:
        return _run_drawing(options)
    from faceposer.cli.opening import open_with_remark
    from faceposer.files.writing import write_json
    from faceposer.session.report import sketch_report
    from faceposer.session.sketch_strokes import add_strokes
    from faceposer.sketch.strokes_file import read_strokes
    from faceposer.solve.camera_io import read_camera

    session = open_with_remark(options.what)
    character = session.model.character
    camera = None if options.camera is None else read_camera(options.camera, character, of_face=True)
    strokes = read_strokes(options.strokes, character, camera)
    _apply_settings(options, session)
    line = ProgressLine()
    began = time.perf_counter()
    try:
        recognised = add_strokes(session, strokes, options.recognition, line.progress)
    finally:
        line.clear()
    seconds = time.perf_counter() - began
    session.save(options.output, strokes[-1].camera)
    if options.report is not None:
        write_json(options.report, sketch_report(strokes, recognised, seconds), "report")
    for i, (stroke, found) in enumerate(zip(strokes, recognised, strict=True)):
        print(printable(f"stroke {i}: {_described(found, stroke.feature)}"))
    count = sum(found.best is not None for found in recognised)
    print(f"{options.output} written: {count} of {len(strokes)} strokes recognised, {seconds:.1f} s")
    return 0


def _run_drawing(options: argparse.Namespace) -> int:
    """Pose the face by a drawing."""
    from faceposer.cli.opening import open_with_remark
    from faceposer.files.writing import write_json
    from faceposer.model.framing import face_view
    from faceposer.session.drawings import Relative, add_sketches, drawing_report, read_drawing
    from faceposer.solve.camera_io import read_camera

    relative = Relative.of(options.relative or "auto")
    check_not_input(options.output, relative.neutral)
    session = open_with_remark(options.what)
    character = session.model.character
    if options.camera is None:
        camera = face_view(character).camera(_DRAWING_SIZE)
    else:
        camera = read_camera(options.camera, character, of_face=True)
    _apply_settings(options, session)
    line = ProgressLine()
    began = time.perf_counter()
    try:
        found, sketches = read_drawing(session.model, options.strokes, camera, relative, line.progress)
        add_sketches(session, sketches, options.strokes.name)
        session.wait()
    finally:
        line.clear()
    seconds = time.perf_counter() - began
    session.save(options.output, camera)
    if options.report is not None:
        write_json(options.report, drawing_report(found, seconds), "report")
    for i, stroke in enumerate(found.strokes):
        print(printable(f"line {i}{f' ({stroke.name})' if stroke.name else ''}: {_line_described(stroke)}"))
    for remark in found.remarks:
        print(printable(remark))
    print(f"{options.output} written: {len(sketches)} of {len(found.strokes)} lines are features, {seconds:.1f} s")
    return 0


def _apply_settings(options: argparse.Namespace, session: "Session") -> None:
    """Change what the options of the face state, and solve."""
    if options.spread is not None:
        session.set_spread(options.spread)
    if options.method is not None:
        session.set_sketch_method(options.method)
    session.wait()


def _line_described(stroke: Any) -> str:
    """Return a phrase for the line ``stroke`` of a drawing."""
    if stroke.joined is not None:
        return f"continues line {stroke.joined}"
    if stroke.only_aligns:
        return f"{stroke.stroke.feature or 'nose'}, used to align the drawing"
    if stroke.candidate is None:
        return "no feature"
    rest = f", else {stroke.runner_up.feature}" if stroke.runner_up is not None else ""
    return f"{stroke.candidate.feature} ({100.0 * stroke.candidate.probability:.0f} %{rest})"


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
