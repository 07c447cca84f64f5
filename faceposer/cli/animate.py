"""``faceposer animate``: animates a face by the trajectories of a few points, or by a film of a face."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from faceposer.cli.arguments import (
    add_contact_option,
    add_rate_option,
    add_spread,
    number_between,
    output_path,
)
from faceposer.cli.progress_line import ProgressLine
from faceposer.errors import FacePoserError, counted
from faceposer.files.atomic import check_distinct, check_not_input, check_output

if TYPE_CHECKING:
    pass

NAME = "animate"
#: Suffixes of trajectories; everything else may be a film.
TRAJECTORY_SUFFIXES = (".csv", ".json", ".c3d", ".trc")
_PRIORS = ("regions", "whole", "plain")


def add_parser(commands: Any) -> None:
    """Add the parser of ``animate`` to ``commands``."""
    parser: argparse.ArgumentParser = commands.add_parser(
        NAME,
        help="animate a face by a film, or by the trajectories of a few points",
        description="Solve a pose for every frame so that points of the face follow trajectories in an image or in "
        "space (docs/animation.md), or so that the face has the expressions of a person in a film (docs/film.md), "
        "smoothly and naturally, and write the animation.",
    )
    parser.add_argument("character", metavar="CHARACTER", help="name of a character, or character file (.npz)")
    parser.add_argument(
        "motion",
        type=Path,
        metavar="TRAJECTORIES|FILM",
        help="trajectories (.csv, .json, .c3d or .trc), or a film: a video (.mp4, .mov, .webm and others; needs PyAV, "
        "pip install 'faceposer[film]'), an animated .gif, or a folder of pictures",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=output_path,
        metavar="OUT",
        required=True,
        help="animation to write: weights (.json, or .csv for Live Link Face), .glb, .gif or .mp4",
    )
    parser.add_argument(
        "--session",
        type=output_path,
        metavar="SESSION.json",
        help="also write a session with the animation as keys, as few as reproduce it",
    )
    film = parser.add_argument_group("of films")
    film.add_argument("--from", dest="start", type=_seconds, metavar="TIME", help="begin at this time: 2.5, or 1:02.5")
    film.add_argument("--to", dest="end", type=_seconds, metavar="TIME", help="end at this time")
    film.add_argument(
        "--landmarks-only",
        dest="colours",
        action="store_false",
        help="follow landmarks, not colours: ten times as fast, and less exact",
    )
    film.add_argument(
        "--report", type=output_path, metavar="R.json", help="what was measured, and the motion of the head"
    )
    parser.add_argument("--camera", type=Path, metavar="JSON", help="camera of trajectories in pixels")
    parser.add_argument("--markers", type=Path, metavar="JSON", help="marker map: the place on the face of each point")
    parser.add_argument("--points", type=_names, metavar="A,B", help="points to follow (default: all)")
    parser.add_argument("--keep-jumps", action="store_true", help="keep positions that jump away for a frame or two")
    add_contact_option(parser)
    add_rate_option(parser, "the trajectories, or at which the film is sampled")
    parser.add_argument(
        "--smoothness", type=_weight, metavar="W", default=1.0, help="weight of changes of velocity (default: 1)"
    )
    parser.add_argument(
        "--prior-weight", type=_weight, metavar="W", default=1.0, help="weight of the prior (default: 1)"
    )
    parser.add_argument(
        "--prior",
        choices=_PRIORS,
        default="regions",
        help="how the prior is evaluated: per region, over the whole face, or as the plain mixture (default: regions)",
    )
    add_spread(parser, "1, suited to recordings of a real face")


def run(options: argparse.Namespace) -> int:
    """Solve and write the animation, and return the exit status."""
    from faceposer.film.opening import is_film
    from faceposer.interchange.formats import check_writable

    check_writable(options.output, lambda form: form.animated)
    for path in (options.output, options.session, options.report):
        check_not_input(path, options.character, options.motion, options.camera, options.markers)
    for path in (options.session, options.report):
        if path is not None:
            check_output(path, ".json")
    check_distinct(options.output, options.session, options.report)
    if options.motion.suffix.lower() not in TRAJECTORY_SUFFIXES and is_film(options.motion):
        from faceposer.cli.animate_film import animate_by_film

        return animate_by_film(options)
    if options.motion.suffix.lower() not in TRAJECTORY_SUFFIXES:
        raise _unusable(options.motion)
    if options.start is not None or options.end is not None or not options.colours or options.report is not None:
        raise FacePoserError("--from, --to, --landmarks-only and --report are for films, not for trajectories.")
    return _follow(options)


def _unusable(path: Path) -> FacePoserError:
    """Return the error of ``path``, which is neither a film nor trajectories."""
    from faceposer.files import paths

    if not paths.exists(path):
        return FacePoserError(f"There is no film, folder or file of trajectories '{path}'; check the path.")
    return FacePoserError(
        f"'{path}' is neither a film nor trajectories; give a video, an animated .gif, a folder of pictures, or "
        "trajectories (.csv, .json, .c3d or .trc)."
    )


def _follow(options: argparse.Namespace) -> int:
    """Animate the face by trajectories, and return the exit status."""
    import numpy as np

    from faceposer.animation.following import residuals, solve_trajectories
    from faceposer.animation.trajectory_io import read_trajectories
    from faceposer.cli.opening import print_notes
    from faceposer.geometry.marker_map import read_marker_map
    from faceposer.interchange.formats import write
    from faceposer.render.options import OutputOptions
    from faceposer.session.opening import load_model
    from faceposer.solve.camera_io import read_camera
    from faceposer.solve.problem import RECORDED_SPREAD

    model = load_model(options.character)
    trajectories = read_trajectories(
        options.motion,
        model.character,
        camera=None if options.camera is None else read_camera(options.camera, model.character),
        marker_map=None if options.markers is None else read_marker_map(options.markers),
        points=options.points,
        rate=options.rate,
    )
    print_notes(options.motion, " ".join(trajectories.notes))
    jumps = 0
    if not options.keep_jumps:
        trajectories, jumps = trajectories.without_jumps()
    n_frames = len(trajectories)
    line = ProgressLine()
    try:
        performance = solve_trajectories(
            model,
            trajectories,
            smoothness=options.smoothness,
            prior_weight=options.prior_weight,
            prior=options.prior,
            spread=RECORDED_SPREAD if options.spread is None else options.spread,
            progress=line.progress,
        )
        write(options.output, model, performance, OutputOptions(contact=options.contact), line.progress)
    finally:
        line.clear()
    error, unit = np.nanmean(residuals(model, trajectories, performance)), "px"
    if trajectories.camera is None:
        error, unit = 10.0 * error, "mm"
    without_points = int((~trajectories.seen.any(axis=1)).sum())
    remarks = f", {without_points} of them without points" if without_points else ""
    remarks += f"; jumps removed: {jumps}" if jumps else ""
    length = f"{counted(n_frames, 'frame')} at {performance.rate:g} fps"
    print(f"{options.output} written: {length}, mean error {error:.1f} {unit}{remarks}")
    if options.session is not None:
        from faceposer.cli.animated_session import write_session

        write_session(options.session, options.character, performance)
    return 0


def _names(text: str) -> tuple[str, ...]:
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    if not names:
        raise argparse.ArgumentTypeError("give at least one point; separate several by commas")
    return names


def _weight(text: str) -> float:
    return number_between(text, 0.0, 1e6)


def _seconds(text: str) -> float:
    """Parse ``text`` as a time: seconds, or hours and minutes before them, separated by colons."""
    from faceposer.film.film import seconds_of

    try:
        return seconds_of(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is no time in seconds such as 12.5, nor 1:02.5") from None
