"""``faceposer export``: a face, posed or in motion, to files of other programs."""

import argparse
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from faceposer.cli_applications.contact_option import add_contact_option
from faceposer.cli_applications.progress_line import ProgressLine
from faceposer.errors import FacePoserError
from faceposer.interchange.files import check_apart, check_output

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from faceposer.model.performance import Performance
    from faceposer.session.session import Session

NAME = "export"
T = TypeVar("T")

_VIEWS = ("front", "three-quarter", "left", "right", "back")
_MAX_SIDE = 8192
_MOST_SECONDS = 3600.0
_FASTEST = 240.0
_GIF_SIZE = (480, 480)

_DESCRIPTION = """\
Write a face as other programs read it. The suffix of OUT says how:

  .obj   the posed mesh with UVs, normals and groups, in the character's own unit, axes and order
  .ply   the same mesh, binary, with normals
  .glb   parts, textures and all shapes as morph targets with their names, in metres;
         the pose as default weights, an animation as keys of the weights; targets cannot hold
         the contact step, so that lids, lips and teeth may lie in each other there
  .csv   weights of ARKit's 52 shapes, from 0 to 1, as Live Link Face writes them
  .json  weights of the face's own shapes (docs/interchange.md)
  .png   a picture of the pose
  .gif   the animation, or the pose turning round
  .mp4   the same, by ffmpeg

What is written is the session's: its animation, if its timeline has keys and the format holds one, otherwise its pose;
the neutral face of a subject; or what --pose or --animation says."""

_EXAMPLES = """\
examples:
  faceposer export smile.json -o smile.glb                         to Blender, Unity, Unreal, the web
  faceposer export woman --animation take.csv -o woman.glb         a performance of Live Link Face on the woman
  faceposer export woman --animation take.csv -o take --sequence obj    ... as a folder of meshes
  faceposer export woman --animation take.csv --fps 25 -o take.gif
  faceposer export keys.json -o keys.glb                           what the timeline of a session plays
  faceposer export smile.json --turntable 6 --size 800x800 -o smile.mp4
  faceposer export man --pose sculpted.obj -o sculpted.csv         what weights make this mesh?
  faceposer export man --pose take.csv --frame 120 -o frame.obj"""


def add_parser(commands: Any) -> None:
    """Add the parser of the command."""
    parser = commands.add_parser(
        NAME,
        help="write a face as OBJ, PLY, GLB, CSV, JSON, PNG, GIF or MP4",
        description=_DESCRIPTION,
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("what", metavar="SUBJECT|SESSION", help="name or path of a subject, or a session file")
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
        "--sequence", choices=("obj", "ply"), help="write the animation into the new folder OUT, one mesh per frame"
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
        help="let the camera go round the head in this time, for .gif and .mp4 (a pose alone: default 4)",
    )
    parser.add_argument(
        "--view", choices=_VIEWS, default="front", help="where pictures look from, or begin (default: front)"
    )
    parser.add_argument(
        "--size", type=_size, metavar="WxH", help="pixels of pictures (default: 640x640; 480x480 for .gif)"
    )
    add_contact_option(parser)
    parser.add_argument("--clay", action="store_true", help="draw pictures without the texture of the skin")
    parser.add_argument(
        "--no-expression-lines",
        action="store_true",
        help="draw pictures without the lines that a pose makes in the skin",
    )


def run(options: argparse.Namespace) -> int:
    """Write what ``options`` ask for and return the exit status."""
    _check_options(options)
    from faceposer.cli_applications.opening import open_with_remark
    from faceposer.interchange.meshes import write_sequence
    from faceposer.interchange.sampling import resampled
    from faceposer.model.performance import Performance
    from faceposer.viewer.exporting import Look, write

    session = open_with_remark(options.what)
    session.wait()
    motion = _motion(options, session)
    path: Path = options.output
    contact = session.document.contact and options.contact
    if options.sequence is not None:
        if not isinstance(motion, Performance):
            raise FacePoserError(
                f"--sequence writes an animation, and '{options.what}' has none; give one with --animation."
            )
        frames = resampled(motion, options.fps) if options.fps else motion
        written = _with_progress(
            lambda progress: write_sequence(path, session.model, frames, options.sequence, progress, contact)
        )
        _say(f"{len(written)} meshes written to {path}")
        return 0
    pictures = path.suffix.lower() in (".gif", ".mp4")
    if isinstance(motion, Performance) and options.fps and not pictures:
        motion = resampled(motion, options.fps)
    look = Look(
        options.size or (_GIF_SIZE if path.suffix.lower() == ".gif" else Look.size),
        options.view,
        options.turntable or 0.0,
        options.fps,
        "clay" if options.clay else "full",
        expression_lines=not options.no_expression_lines,
        contact=contact,
    )
    _with_progress(lambda progress: write(path, session.model, motion, look, progress))
    _say(f"{path} written")
    return 0


def _with_progress(export: Callable[[Callable[[float], None]], T]) -> T:
    """Return what ``export`` returns, while it tells how far it is."""
    line = ProgressLine()
    try:
        return export(line.share)
    finally:
        line.clear()


def _motion(options: argparse.Namespace, session: "Session") -> "NDArray[np.float64] | Performance":
    """Return the pose, shape (r,), or the performance that is asked for."""
    from faceposer.interchange.reading import read_performance, read_pose
    from faceposer.viewer.exporting import ANIMATED

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
    moves = options.sequence is not None or options.output.suffix.lower() in ANIMATED
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
    path: Path = options.output
    suffix = path.suffix.lower()
    if options.frame is not None and options.pose is None:
        raise FacePoserError("--frame says which frame of the weights in --pose; give that, too.")
    if options.sequence is not None:
        if options.pose is not None or options.still:
            raise FacePoserError("--sequence writes an animation; leave out --pose and --still.")
        if not path.absolute().parent.is_dir():
            raise FacePoserError(f"The folder '{path.absolute().parent}' of the output does not exist; make it first.")
        return
    suffixes = (".obj", ".ply", ".glb", ".csv", ".json", ".png", ".gif", ".mp4")
    if suffix not in suffixes:
        raise FacePoserError(f"The output '{path}' must end in one of {', '.join(suffixes)}.")
    check_output(path, suffix)
    if options.animation is not None and suffix in (".obj", ".ply"):
        raise FacePoserError(
            f"'{path}' holds one pose: write the animation into a folder with --sequence {suffix[1:]}, or one frame of "
            "it with --pose and --frame."
        )
    if options.animation is not None and suffix == ".png":
        raise FacePoserError(f"'{path}' shows one pose: write a .gif, or one frame with --pose and --frame.")
    if options.turntable is not None and suffix not in (".gif", ".mp4"):
        raise FacePoserError("--turntable is for films; let the output end in .gif or .mp4.")
    check_apart(path, options.what, options.pose, options.animation)


def _say(text: str) -> None:
    if text.strip():
        print(text.strip())


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,5})[xX](\d{1,5})", text)
    sides = tuple(int(side) for side in match.groups()) if match else ()
    if len(sides) != 2 or not all(16 <= side <= _MAX_SIDE for side in sides):
        raise argparse.ArgumentTypeError(f"'{text}' is not a size such as 960x720, with sides from 16 to {_MAX_SIDE}")
    return (sides[0], sides[1])


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
