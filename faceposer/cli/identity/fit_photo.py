"""``faceposer identity fit-photo``: makes a character of photos of a person."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from faceposer.cli.arguments import number_between, output_path
from faceposer.cli.identity.heads import ROOM, check_titles
from faceposer.errors import FacePoserError, counted, printable
from faceposer.files.atomic import check_distinct, check_not_input, check_output, check_space
from faceposer.files.paths import same_file
from faceposer.identity.photos import LIKELIHOODS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from faceposer.identity.photos.head_from_photos import HeadFromPhotos
    from faceposer.photo.faces import FaceInPhoto

NAME = "fit-photo"
_MOST_PHOTOS = 20


def add_parser(subcommands: Any) -> None:
    """Add the parser of ``fit-photo`` to ``subcommands``."""
    parser = subcommands.add_parser(
        NAME,
        help="make a character of photos of a person",
        description="Make a character of one or more photos of a person (docs/photo-heads.md).",
    )
    parser.add_argument(
        "photos", nargs="+", type=Path, metavar="PHOTO", help="photo: JPEG, PNG or another common format"
    )
    parser.add_argument(
        "-o", "--output", type=output_path, required=True, metavar="CHARACTER.npz", help="write the character"
    )
    parser.add_argument("--report", type=output_path, metavar="R.json", help="write what was measured")
    parser.add_argument(
        "--session",
        type=output_path,
        metavar="SESSION.json",
        help="write a session with the character, the first photo, its camera and its expression",
    )
    parser.add_argument(
        "--likelihood",
        type=lambda text: number_between(text, *LIKELIHOODS),
        default=1.0,
        metavar="X",
        help=f"weight of what is usual, from {LIKELIHOODS[0]:g} for likeness to {LIKELIHOODS[1]:g} for a likely head "
        "(default: 1)",
    )
    parser.add_argument(
        "--landmarks-only", dest="dense", action="store_false", help="use landmarks, not the colours of the photos"
    )
    parser.add_argument(
        "--painting",
        action="store_true",
        help="the photos are of paintings or drawings: a likelier head, and the skin keeps the painter's colours",
    )
    parser.add_argument(
        "--pins",
        nargs="+",
        action="extend",
        type=Path,
        default=[],
        metavar="PINS.json",
        help="pins on feature points of each photo, in their order, to which the landmarks are moved; - for a "
        "photo without (docs/photo-heads.md)",
    )
    parser.add_argument("--name", help="short name of the character; that of the output if not given")
    parser.add_argument("--title", help="display name of the character; its short name if not given")


def run(options: argparse.Namespace) -> int:
    """Fit the head, write what is asked for and return the exit status."""
    outputs = ((options.output, ".npz"), (options.report, ".json"), (options.session, ".json"))
    for path, suffix in outputs:
        if path is not None:
            check_output(path, suffix)
            check_space(path, ROOM[suffix])
            check_not_input(path, *options.photos, *options.pins)
    check_distinct(*(path for path, _ in outputs))
    check_titles(options)
    from faceposer.cli.opening import print_notes
    from faceposer.cli.progress_line import ProgressLine
    from faceposer.files.writing import write_json
    from faceposer.identity.photos.head_from_photos import head_from_photos
    from faceposer.model.character_file import save_character
    from faceposer.photo.faces import note_of_others, read_face

    if len(options.photos) > _MOST_PHOTOS:
        raise FacePoserError(f"There are {len(options.photos)} photos; give at most {_MOST_PHOTOS}.")
    for number, path in enumerate(options.photos):
        if any(same_file(path, other) for other in options.photos[:number]):
            raise FacePoserError(f"The photo '{path}' is given twice; give each photo once.")
    pins = _pins_of(options)
    found = []
    for path, given in zip(options.photos, pins, strict=True):
        one = read_face(path, pins=given)
        # Pins say which face is meant.
        print_notes(path, "" if given else note_of_others(one))
        found.append(one.cut())
    name = options.name or options.output.stem
    line = ProgressLine()
    try:
        made = head_from_photos(
            [one.face for one in found],
            [one.pixels for one in found],
            [str(path) for path in options.photos],
            name=name,
            title=options.title or name,
            likelihood=options.likelihood,
            dense=options.dense,
            painting=options.painting,
            progress=line.progress,
        )
    finally:
        line.clear()
    save_character(options.output, made.character)
    for photo in made.report["photos"]:
        colours = "" if photo["residual"] is None else f", colours {photo['residual']:.3f}"
        print(printable(f"{photo['photo']}: landmarks {photo['landmark_px']:.1f} px{colours} off"))
    if options.dense and not made.report["refined"]:
        print("Colours did not improve the head, which is that of the landmarks.")
    print(f"{options.output} written from {counted(len(found), 'photo')} in {made.report['seconds']:.1f} s")
    if options.report is not None:
        write_json(options.report, made.report, "report")
        print(f"{options.report} written")
    if options.session is not None:
        _write_session(options, found, made)
        print(f"{options.session} written")
    return 0


def _pins_of(options: argparse.Namespace) -> list[dict[str, tuple[float, float]]]:
    """Return the pins on each photo by name of feature point.

    Raises:
        FacePoserError: If there are not as many files as photos, or one cannot be used.
    """
    from faceposer.landmarks.feature_points import EXTRAPOLATED
    from faceposer.model.character_file import load_character
    from faceposer.photo.pins_file import check_inside, read_pins
    from faceposer.photo.reading import inspect_photo

    if not options.pins:
        return [{} for _ in options.photos]
    if len(options.pins) != len(options.photos):
        raise FacePoserError(
            f"{counted(len(options.photos), 'photo')} and {counted(len(options.pins), 'file')} of pins were given; "
            "give one file for each photo, or - for a photo without."
        )
    known = set(load_character("man").feature_points) - set(EXTRAPOLATED)
    result = []
    for path, photo in zip(options.pins, options.photos, strict=True):
        pins = () if str(path) == "-" else read_pins(path)
        check_inside(path, pins, inspect_photo(photo).size)
        for i, pin in enumerate(pins):
            if not (isinstance(pin.place, str) and pin.place in known):
                raise FacePoserError(
                    f"In '{path}', pins[{i}] is not on a feature point that landmarks have; remove it, or take the "
                    "names that 'faceposer landmarks PHOTO --pins' writes."
                )
        result.append({str(pin.place): pin.pixel for pin in pins})
    return result


def _write_session(options: argparse.Namespace, found: "Sequence[FaceInPhoto]", made: "HeadFromPhotos") -> None:
    """Write the session of the first photo, whose pose is its expression."""
    from dataclasses import replace

    from faceposer.cli.opening import open_with_remark
    from faceposer.photo.photo import Photo, Pin

    first = found[0]
    camera = first.full_camera(made.cameras[0])
    pins = tuple(Pin(place, pixel) for place, pixel in first.features().items())
    photo = Photo(str(first.path.absolute()), first.file.size, pins, camera, first.file.focal)
    photo = photo.with_expression(made.model, made.poses[0])
    session = open_with_remark(str(options.output))
    with session.edit("Open a photo"):
        session.replace(replace(session.document, photos=(photo,)))
    session.rebase_pose(made.poses[0], "Take the expression")
    session.wait()
    session.save(options.session, camera)
