"""``faceposer export``: writes a posed or animated face for other programs."""

import argparse
import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from faceposer.cli.arguments import (
    add_contact_option,
    add_materials_option,
    add_rate_option,
    image_size,
    number,
    output_path,
)
from faceposer.cli.progress_line import ProgressLine
from faceposer.errors import FacePoserError, counted, printable
from faceposer.files.atomic import check_not_input, check_sequence_folder

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from faceposer.model.performance import Performance
    from faceposer.session.session import Session

NAME = "export"

_VIEWS = ("front", "three-quarter", "left", "right", "back")
_LARGEST_SIDE = 8192
_LONGEST_TURN = 3600.0
_HIGHEST_RATE = 240.0
_GIF_SIZE = (480, 480)

_DESCRIPTION = """\
Write a face for other programs. The suffix of OUT selects the format:

{formats}

A session is written with its animation, if its timeline has keys and the format holds one, otherwise with its pose; a
character with its neutral face. --pose and --animation replace these. docs/interchange.md describes each format."""

_EXAMPLES = """\
examples:
  faceposer export smile.json -o smile.glb                         to Blender, Unity, Unreal, the web
  faceposer export woman --animation take.csv -o woman.glb         a performance of Live Link Face on the woman
  faceposer export woman --animation take.csv -o take --sequence obj    ... as a folder of meshes
  faceposer export woman --animation take.csv --fps 25 -o take.gif
  faceposer export keys.json -o keys.glb                           the animation of a session
  faceposer export keys.json -o keys --sequence png --transparent  ... as images without background
  faceposer export smile.json --turntable 6 --size 800x800 -o smile.mp4
  faceposer export man --pose sculpted.obj -o sculpted.csv         the weights that fit a sculpted mesh
  faceposer export man --pose take.csv --frame 120 -o frame.obj"""


def add_parser(commands: Any) -> None:
    """Add the parser of ``export`` to ``commands``."""
    parser = commands.add_parser(
        NAME,
        help="write a face for other programs: meshes, weights, images and videos",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    # The table of formats is slow to import, and only the help of this command needs it here.
    parser.format_help = lambda: _help_with_formats(parser)
    parser.add_argument("what", metavar="CHARACTER|SESSION", help="name or file of a character, or a session file")
    parser.add_argument(
        "-o", "--output", type=output_path, metavar="OUT", required=True, help="file or folder to write"
    )
    motion = parser.add_mutually_exclusive_group()
    motion.add_argument(
        "--pose",
        type=Path,
        metavar="FILE",
        help="write the pose of a mesh of this face (.obj, .ply), or of weights as for --animation",
    )
    motion.add_argument(
        "--animation",
        type=Path,
        metavar="FILE",
        help="write the animation of a file of weights: a take of Live Link Face or Face Cap (.csv, .txt), .json, or "
        "the morph targets of .glb",
    )
    parser.add_argument(
        "--inbetweens",
        choices=("poses", "feature points"),
        metavar='poses|"feature points"',
        help="motion between the keys of a session: curves of rig weights, or splines of feature points (default: that "
        "of the session)",
    )
    parser.add_argument("--still", action="store_true", help="write the pose of a session, even if it has keys")
    parser.add_argument("--frame", type=_frame, metavar="N", help="frame of the weights in --pose, from 1 (default: 1)")
    parser.add_argument(
        "--sequence",
        metavar="obj|ply|png",
        help="write the animation to the new folder OUT, one file per frame",
    )
    add_rate_option(parser, "the weights in --animation")
    parser.add_argument(
        "--fps",
        type=_rate,
        metavar="RATE",
        help="frames per second (default: those of the animation, at most 25 for .gif)",
    )
    parser.add_argument(
        "--turntable",
        type=_seconds,
        metavar="SECONDS",
        help="duration of one turn of the camera around the head, for videos (default: 4 for a pose, none for an "
        "animation)",
    )
    parser.add_argument(
        "--view", choices=_VIEWS, default="front", help="view of images, or first view of a turn (default: front)"
    )
    parser.add_argument(
        "--size",
        type=partial(image_size, least=16, most=_LARGEST_SIDE),
        metavar="WxH",
        help="width and height of images in pixels (default: 640x640; 480x480 for .gif)",
    )
    add_contact_option(parser)
    add_materials_option(parser)
    parser.add_argument(
        "--transparent", action="store_true", help="make the background of .png and --sequence png transparent"
    )
    parser.add_argument("--clay", action="store_true", help="render images without skin texture")
    parser.add_argument(
        "--no-expression-lines",
        action="store_true",
        help="render images without expression lines",
    )


def _help_with_formats(parser: argparse.ArgumentParser) -> str:
    """Return the help of ``parser`` with the table of formats in its description."""
    from faceposer.interchange.formats import FORMATS

    lines = "\n".join(f"  {suffix:6} {form.purpose}" for suffix, form in FORMATS.items())
    parser.description = _DESCRIPTION.format(formats=lines)
    return type(parser).format_help(parser)


def run(options: argparse.Namespace) -> int:
    """Write the file or the sequence and return the exit status."""
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
    is_video = options.sequence is None and format_of(path).holds == "film"
    if isinstance(motion, Performance) and options.fps and not is_video:
        motion = resampled(motion, options.fps)
    output_options = OutputOptions(
        options.size or (_GIF_SIZE if path.suffix.lower() == ".gif" else OutputOptions.size),
        options.view,
        options.turntable or 0.0,
        options.fps if is_video else None,
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
                f"--sequence writes an animation, but '{options.what}' has none; give one with --animation."
            )
        else:
            output = Output(path, session.model, motion, output_options)
            for share in write_sequence_steps(output, f".{options.sequence}"):
                line.share(share)
    finally:
        line.clear()
    print(f"{path} written" if options.sequence is None else f"{counted(len(motion), 'file')} written to {path}")
    return 0


def _motion(options: argparse.Namespace, session: "Session") -> "NDArray[np.float64] | Performance":
    """Return the pose, shape (r,), or the performance to write."""
    from faceposer.cli.opening import print_notes
    from faceposer.interchange.formats import format_of
    from faceposer.interchange.reading import read_performance, read_pose

    model = session.model

    if options.animation is not None:
        animation = read_performance(options.animation, model, options.rate)
        count, rate = len(animation.performance), animation.performance.rate
        length = f"{counted(count, 'frame')} at {rate:g} fps" if count > 1 else "a single frame"
        print(printable(f"{options.animation}: {length}"))
        print_notes(options.animation, animation.note)
        return animation.performance
    if options.pose is not None:
        read = read_pose(options.pose, model, (options.frame or 1) - 1)
        if read.note:
            print(printable(f"{options.pose}: {read.note}"))
        return read.coefficients
    holds_animation = options.sequence is not None or format_of(options.output).animated
    if options.inbetweens is not None:
        controller = session.animation
        if controller.performance is None:
            raise FacePoserError(f"--inbetweens applies to the keys of a session, but '{options.what}' has none.")
        controller.change(replace(controller.keyframes, inbetweens=options.inbetweens), "Change the in-betweens")
    performance = session.animation.performance if holds_animation and not options.still else None
    if performance is not None and len(performance) > 1:
        print(printable(f"{options.what}: {counted(len(performance), 'frame')} at {performance.rate:g} fps"))
        return performance
    return session.coefficients


def _check_options(options: argparse.Namespace) -> None:
    """Reject incompatible options before anything is read.

    Raises:
        FacePoserError: If options exclude each other, or do not fit the format.
    """
    from faceposer.interchange.formats import FORMATS, check_writable, suffixes

    path: Path = options.output
    suffix = path.suffix.lower()
    if options.inbetweens is not None and (options.animation or options.pose or options.still):
        raise FacePoserError(
            "--inbetweens applies to the keys of a session; leave out --animation, --pose and --still."
        )
    if options.frame is not None and options.pose is None:
        raise FacePoserError("--frame selects a frame of the weights in --pose; give --pose as well.")
    if options.rate is not None and options.animation is None:
        raise FacePoserError("--rate is the frame rate of the weights in --animation; give --animation as well.")
    if options.sequence is not None:
        kinds = [kind[1:] for kind in suffixes(lambda form: form.sequence is not None)]
        if options.sequence not in kinds:
            raise FacePoserError(f"--sequence takes {', '.join(kinds)}, not '{options.sequence}'.")
        if options.pose is not None or options.still:
            raise FacePoserError("--sequence writes an animation; leave out --pose and --still.")
        if options.transparent and not FORMATS[f".{options.sequence}"].transparent:
            raise FacePoserError("--transparent applies to images only; use --sequence png.")
        check_sequence_folder(path)
        return
    check_writable(path)
    form = FORMATS[suffix]
    if options.animation is not None and form.holds == "pose" and form.drawn:
        raise FacePoserError(f"'{path}' shows a single pose; write a .gif, or one frame with --pose and --frame.")
    if options.animation is not None and form.holds == "pose":
        folder = f"write the animation to a folder with --sequence {suffix[1:]}, or " if form.sequence else "write "
        raise FacePoserError(f"'{path}' holds one pose; {folder}one of its frames with --pose and --frame.")
    if options.turntable is not None and form.holds != "film":
        videos = " or ".join(suffixes(lambda form: form.holds == "film"))
        raise FacePoserError(f"--turntable applies to videos only; use an output that ends in {videos}.")
    if options.transparent and not form.transparent:
        raise FacePoserError("--transparent applies to images only; use an output that ends in .png.")
    check_not_input(path, options.what, options.pose, options.animation)


def _positive_number(text: str, most: float, unit: str) -> float:
    value = number(text)
    if not 0.0 < value <= most:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of {unit} above 0 and up to {most:g}")
    return value


def _seconds(text: str) -> float:
    return _positive_number(text, _LONGEST_TURN, "seconds")


def _rate(text: str) -> float:
    return _positive_number(text, _HIGHEST_RATE, "frames per second")


def _frame(text: str) -> int:
    if not re.fullmatch(r"[1-9][0-9]{0,8}", text):
        raise argparse.ArgumentTypeError(f"'{text}' is not a frame number; frames are numbered from 1")
    return int(text)
