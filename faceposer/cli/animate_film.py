"""``faceposer animate CHARACTER FILM``: the expressions of a person in a film on a character."""

import argparse
import sys
from dataclasses import replace
from typing import TYPE_CHECKING

from faceposer.cli.progress_line import ProgressLine
from faceposer.errors import FacePoserError, counted, printable

if TYPE_CHECKING:
    from faceposer.film.film import Span

_LONGEST = 4000


def animate_by_film(options: argparse.Namespace) -> int:
    """Animate the character by the film, write the animation, and return the exit status."""
    for given, name in (
        (options.camera, "--camera"),
        (options.markers, "--markers"),
        (options.points, "--points"),
        (options.spread, "--spread"),
        (options.keep_jumps or None, "--keep-jumps"),
        (None if options.prior_weight == 1.0 else options.prior_weight, "--prior-weight"),
        (None if options.prior == "regions" else options.prior, "--prior"),
    ):
        if given is not None:
            raise FacePoserError(f"{name} is for trajectories, not for films.")
    span = _span(options)
    from faceposer.animation.keyframes import FilmSource
    from faceposer.cli.animated_session import write_session
    from faceposer.files.writing import write_json
    from faceposer.film.expression import expression_of_film
    from faceposer.interchange.formats import write
    from faceposer.render.options import OutputOptions
    from faceposer.session.opening import load_model

    model = load_model(options.character)
    line = ProgressLine()
    try:
        found = expression_of_film(
            options.motion,
            model,
            span=span,
            rate=options.rate,
            smoothness=options.smoothness,
            colours=options.colours,
            progress=line.progress,
        )
        write(options.output, model, found.performance, OutputOptions(contact=options.contact), line.progress)
    finally:
        line.clear()
    for note in found.notes:
        print(printable(f"{options.motion}: {note}", _LONGEST), file=sys.stderr)
    report = found.report
    length = f"{counted(len(found.performance), 'frame')} at {found.performance.rate:g} fps"
    print(
        f"{options.output} written: {length}, landmarks {report['landmark_px']:.1f} px off the person's head, in "
        f"{report['seconds']:.0f} s"
    )
    if options.report is not None:
        write_json(options.report, report, "report")
        print(f"{options.report} written")
    if options.session is not None:
        source = FilmSource(str(options.motion.absolute()), found.first, found.film.rate)
        write_session(options.session, options.character, found.performance, found.tolerances, source)
    return 0


def _span(options: argparse.Namespace) -> "Span":
    """Return the part of the film that the options name."""
    from faceposer.film.film import Span

    span = Span() if options.start is None else Span(options.start)
    if options.end is not None:
        if options.end <= span.start:
            raise FacePoserError(f"--to {options.end:g} is not after --from {span.start:g}; give a later time.")
        span = replace(span, end=options.end)
    return span
