"""``faceposer export``: a face, posed or in motion, to files of other programs."""

import argparse
import re
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from faceposer.cli.arguments import add_contact_option, add_materials_option, picture_size
from faceposer.cli.progress_line import ProgressLine
from faceposer.errors import FacePoserError, printable
from faceposer.files import paths
from faceposer.files.atomic import check_apart

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from faceposer.model.performance import Performance
    from faceposer.session.session import Session

NAME = "export"

_VIEWS = ("front", "three-quarter", "left", "right", "back")
_MAX_SIDE = 8192
_MOST_SECONDS = 3600.0
_FASTEST = 240.0
_GIF_SIZE = (480, 480)

_DESCRIPTION = """\
Write a face as other programs read it. The suffix of OUT says how:

{formats}

What is written is the session's: its animation, if its timeline has keys and the format holds one, otherwise its pose;
the neutral face of a character; or what --pose or --animation says. docs/interchange.md says what each format holds."""

_EXAMPLES = """\
examples:
  faceposer export smile.json -o smile.glb                         to Blender, Unity, Unreal, the web
  faceposer export woman --animation take.csv -o woman.glb         a performance of Live Link Face on the woman
  faceposer export woman --animation take.csv -o take --sequence obj    ... as a folder of meshes
  faceposer export woman --animation take.csv --fps 25 -o take.gif
  faceposer export keys.json -o keys.glb                           what the timeline of a session plays
  faceposer export keys.json -o keys --sequence png --transparent  ... as pictures without background
  faceposer export smile.json --turntable 6 --size 800x800 -o smile.mp4
  faceposer export man --pose sculpted.obj -o sculpted.csv         what weights make this mesh?
  faceposer export man --pose take.csv --frame 120 -o frame.obj"""


def add_parser(commands: Any) -> None:
    """Add the parser of the command."""
    parser = commands.add_parser(
        NAME,
        help="write a face for other programs: meshes, weights, pictures and films",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    # The table of formats is heavy to import; only the help of this command needs it here.
    parser.format_help = lambda: _described(parser)
    parser.add_argument("what", metavar="CHARACTER|SESSION", help="name or path of a character, or a session file")
    parser.add_argument("-o", "--output", type=Path, metavar="OUT", required=True, help="file or folder to write")
    motion = parser.add_mutually_exclusive_group()
    motion.add_argument(
        "--pose",
        type=Path,
        metavar="FILE",
        help="take the pose from a mesh of this face (.obj, .ply), or from weights as for --animation",
    )
    motion.add_argument(
        "--animation",
        type=Path,
        metavar="FILE",
        help="take an animation from weights: a take of Live Link Face or Face Cap (.csv, .txt), .json, or the morph "
        "targets of .glb",
    )
    parser.add_argument("--still", action="store_true", help="write the pose alone of a session with keys")
    parser.add_argument("--frame", type=_frame, metavar="N", help="which frame of the weights in --pose (default: 1)")
    parser.add_argument(
        "--sequence",
        metavar="obj|ply|png",
        help="write the animation into the new folder OUT, one file per frame",
    )
    parser.add_argument(
        "--fps",
        type=_rate,
        metavar="RATE",
        help="frames per second of what moves (default: as the animation has, at most 25 for .gif)",
    )
    parser.add_argument(
        "--turntable",
        type=_seconds,
        metavar="SECONDS",
        help="let the camera go round the head in this time, for films (a pose alone: default 4)",
    )
    parser.add_argument(
        "--view", choices=_VIEWS, default="front", help="where pictures look from, or begin (default: front)"
    )
    parser.add_argument(
        "--size",
        type=partial(picture_size, least=16, most=_MAX_SIDE),
        metavar="WxH",
        help="pixels of pictures (default: 640x640; 480x480 for .gif)",
    )
    add_contact_option(parser)
    add_materials_option(parser)
    parser.add_argument(
        "--transparent", action="store_true", help="leave out the background of .png, also with --sequence png"
    )
    parser.add_argument("--clay", action="store_true", help="draw pictures without the texture of the skin")
    parser.add_argument(
        "--no-expression-lines",
        action="store_true",
        help="draw pictures without the lines that a pose makes in the skin",
    )


def _described(parser: argparse.ArgumentParser) -> str:
    """Return the help of ``parser`` with the formats that there are."""
    from faceposer.interchange.formats import FORMATS

    lines = "\n".join(f"  {suffix:6} {form.purpose}" for suffix, form in FORMATS.items())
    parser.description = _DESCRIPTION.format(formats=lines)
    return type(parser).format_help(parser)


def run(options: argparse.Namespace) -> int:
    """Write what ``options`` ask for and return the exit status."""
    _check_options(options)
    from faceposer.cli.opening import open_with_remark
    from faceposer.interchange.formats import Output, format_of, write, write_sequence_steps
    from faceposer.model.performance import Performance
    from faceposer.model.sampling import resampled
    from faceposer.render.options import OutputOptions

    session = open_with_remark(options.what)
    session.wait()
    motion = _motion(options, session)
    path: Path = options.output
    contact = session.document.contact and options.contact
    film = options.sequence is None and format_of(path).holds == "film"
    if isinstance(motion, Performance) and options.fps and not film:
        motion = resampled(motion, options.fps)
    output_options = OutputOptions(
        options.size or (_GIF_SIZE if path.suffix.lower() == ".gif" else OutputOptions.size),
        options.view,
        options.turntable or 0.0,
        options.fps if film else None,
        "clay" if options.clay else "full",
        expression_lines=not options.no_expression_lines,
        contact=contact,
        transparent=options.transparent,
        materials=options.materials,
    )
    line = ProgressLine()
    try:
        if options.sequence is None:
            write(path, session.model, motion, output_options, line.progress)
        elif not isinstance(motion, Performance):
            raise FacePoserError(
                f"--sequence writes an animation, and '{options.what}' has none; give one with --animation."
            )
        else:
            output = Output(path, session.model, motion, output_options)
            for share in write_sequence_steps(output, f".{options.sequence}"):
                line.share(share)
    finally:
        line.clear()
    _say(f"{path} written" if options.sequence is None else f"{len(motion)} files written to {path}")
    return 0


def _motion(options: argparse.Namespace, session: "Session") -> "NDArray[np.float64] | Performance":
    """Return the pose, shape (r,), or the performance that is asked for."""
    from faceposer.interchange.formats import format_of
    from faceposer.interchange.reading import read_performance, read_pose

    model = session.model

    if options.animation is not None:
        animation = read_performance(options.animation, model)
        count, rate = len(animation.performance), animation.performance.rate
        length = f"{count} frames at {rate:g} a second" if count > 1 else "a single frame"
        _say(f"{options.animation}: {length}. {animation.note}")
        return animation.performance
    if options.pose is not None:
        read = read_pose(options.pose, model, (options.frame or 1) - 1)
        _say(f"{options.pose}: {read.note}" if read.note else "")
        return read.coefficients
    moves = options.sequence is not None or format_of(options.output).animated
    performance = session.animation.performance if moves and not options.still else None
    if performance is not None and len(performance) > 1:
        _say(f"{options.what}: {len(performance)} frames at {performance.rate:g} a second")
        return performance
    return session.coefficients


def _check_options(options: argparse.Namespace) -> None:
    """Refuse what does not go together before anything is read.

    Raises:
        FacePoserError: Saying what, and what to do.
    """
    from faceposer.interchange.formats import FORMATS, check_writable, suffixes

    path: Path = options.output
    suffix = path.suffix.lower()
    if options.frame is not None and options.pose is None:
        raise FacePoserError("--frame says which frame of the weights in --pose; give that, too.")
    if options.sequence is not None:
        kinds = [kind[1:] for kind in suffixes(lambda form: form.sequence is not None)]
        if options.sequence not in kinds:
            raise FacePoserError(f"--sequence takes {', '.join(kinds)}, and not '{options.sequence}'.")
        if options.pose is not None or options.still:
            raise FacePoserError("--sequence writes an animation; leave out --pose and --still.")
        if options.transparent and not FORMATS[f".{options.sequence}"].transparent:
            raise FacePoserError("--transparent is for pictures; write --sequence png.")
        if not paths.is_dir(path.absolute().parent):
            raise FacePoserError(f"The folder '{path.absolute().parent}' of the output does not exist; make it first.")
        return
    check_writable(path)
    form = FORMATS[suffix]
    if options.animation is not None and form.holds == "pose" and form.drawn:
        raise FacePoserError(f"'{path}' shows one pose: write a .gif, or one frame with --pose and --frame.")
    if options.animation is not None and form.holds == "pose":
        folder = f"write the animation into a folder with --sequence {suffix[1:]}, or " if form.sequence else "write "
        raise FacePoserError(f"'{path}' holds one pose: {folder}one frame of it with --pose and --frame.")
    if options.turntable is not None and form.holds != "film":
        films = " or ".join(suffixes(lambda form: form.holds == "film"))
        raise FacePoserError(f"--turntable is for films; let the output end in {films}.")
    if options.transparent and not form.transparent:
        raise FacePoserError("--transparent is for pictures; let the output end in .png.")
    check_apart(path, options.what, options.pose, options.animation)


def _say(text: str) -> None:
    if text.strip():
        print(printable(text.strip()))


def _number(text: str, most: float, what: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value <= most:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of {what}, up to {most:g}")
    return value


def _seconds(text: str) -> float:
    return _number(text, _MOST_SECONDS, "seconds")


def _rate(text: str) -> float:
    return _number(text, _FASTEST, "frames per second")


def _frame(text: str) -> int:
    if not re.fullmatch(r"[1-9]\d{0,8}", text):
        raise argparse.ArgumentTypeError(f"'{text}' is not the number of a frame, from 1")
    return int(text)
