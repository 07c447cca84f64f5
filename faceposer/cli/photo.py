"""``faceposer photo``: aligns the camera with a photo by pins and poses the face to match."""

import argparse
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from faceposer.cli.arguments import add_spread, number, number_between, output_path, whole_between
from faceposer.errors import FacePoserError, counted, printable
from faceposer.files.atomic import check_distinct, check_not_input, check_output

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from faceposer.photo.photo import Photo, Pin
    from faceposer.session.session import Session

NAME = "photo"
# Size of each panel of the rendered image, in pixels.
_PANEL = (480, 600)
_CHECKED_SIDE = 1024
# Mean error, as a share of the pins' extent, above which no camera explains the pins.
_LARGEST_ERROR = 0.15
# Number of shapes that are listed with the expression of a photo, and the least weight.
_SHOWN, _LEAST_SHOWN = 8, 0.1


def add_parser(commands: Any) -> None:
    """Add the parser of ``photo`` to ``commands``."""
    parser = commands.add_parser(
        NAME,
        help="pose a face from a photo",
        description="Estimate the camera of a photo, pose the face to match and write the session. Or put the face of "
        "a session back into its photo, changed or not: faceposer photo SESSION --render OUT.png.",
    )
    parser.add_argument("what", metavar="CHARACTER|SESSION", help="character, or session to add the photo to")
    parser.add_argument(
        "photo",
        type=Path,
        nargs="?",
        metavar="PHOTO",
        help="photo: JPEG, PNG or another common format; without one, --render puts the face of the session back into "
        "its photo",
    )
    source = parser.add_mutually_exclusive_group()
    source.add_argument("--pins", type=Path, metavar="PINS.json", help="pins on the photo (docs/photo.md)")
    source.add_argument("--auto", action="store_true", help="find the face and take its expression, without pins")
    parser.add_argument(
        "-o", "--output", type=output_path, metavar="SESSION.json", help="session to write; required with PHOTO"
    )
    parser.add_argument(
        "--focal", type=number, metavar="PX", help="focal length in pixels (default: from EXIF, else estimated)"
    )
    add_spread(parser, "that of the session, else 0.5")
    parser.add_argument("--no-pose", action="store_true", help="align the camera only, without posing the face")
    parser.add_argument(
        "--render",
        type=output_path,
        metavar="OUT.png",
        help="also render the photo, the face over it and the face alone; without PHOTO, the photo of the session with "
        "the face as it is now, in the photo's light",
    )
    changes = parser.add_argument_group("changes before the face is put back into the photo of a session")
    changes.add_argument("--pose", metavar="POSE", help="a pose of the library, such as Happiness, or its file (.json)")
    changes.add_argument(
        "--strength",
        type=lambda text: number_between(text, -1.0, 2.0),
        metavar="S",
        help="strength of the pose (default: 1)",
    )
    changes.add_argument(
        "--set",
        nargs="+",
        action="extend",
        default=[],
        metavar="NAME=VALUE",
        help="attributes of the head, such as weight=1.5",
    )
    changes.add_argument(
        "--add",
        nargs="+",
        action="extend",
        default=[],
        metavar="NAME=VALUE",
        help="changes of attributes, such as weight=-0.6",
    )
    changes.add_argument(
        "--photo-number",
        type=whole_between(1, 100),
        metavar="N",
        help="photo of the session, counted from 1 (default: 1)",
    )


def run(options: argparse.Namespace) -> int:
    """Align the photo, pose the face, write the session and return the exit status."""
    if options.photo is None:
        from faceposer.cli.photo_render import render_into_photo

        return render_into_photo(options)
    _check_with_photo(options)
    check_output(options.output, ".json")
    if options.render is not None:
        check_output(options.render, ".png")
    # The output may be the input session, which then gains the photo.
    check_not_input(options.output, options.photo, options.pins)
    check_not_input(options.render, options.what, options.photo, options.pins)
    check_distinct(options.output, options.render)
    if options.focal is not None and not 1.0 <= options.focal <= 1e6:
        raise FacePoserError("The focal length must be between 1 and 1,000,000 pixels.")
    return _run_automatic(options) if options.auto else _run_with_pins(options)


def _run_with_pins(options: argparse.Namespace) -> int:
    """Align the camera by pins, pose the face and return the exit status."""
    from dataclasses import replace

    from faceposer.photo.aligning import aligned, residuals_px
    from faceposer.photo.photo import Photo
    from faceposer.photo.pins_file import check_inside, read_pins
    from faceposer.photo.reading import focal_in_mm, inspect_photo, read_photo
    from faceposer.session.photos import pose_from_photo
    from faceposer.solve.camera_fit import LEAST_POINTS

    file = inspect_photo(options.photo)
    # Decoded early, so that a damaged file is reported before anything is written.
    read_photo(options.photo, _CHECKED_SIDE)
    pins = read_pins(options.pins)
    check_inside(options.pins, pins, file.size)
    session = _opened(options)
    model = session.model
    path = str(options.photo.absolute())
    photo = aligned(Photo(path, file.size, pins, focal=options.focal or file.focal), model, session.coefficients)
    aligned_errors = residuals_px(photo, model, session.coefficients)
    for pin in (pin for i, pin in enumerate(pins) if i not in aligned_errors):
        print(printable(f"pin {pin.place}: '{model.character.title}' has no such feature point"))
    if len(aligned_errors) < LEAST_POINTS:
        raise FacePoserError(
            f"'{options.pins}' has {len(aligned_errors)} usable pins; aligning the camera needs at least "
            f"{LEAST_POINTS}, preferably 8."
        )
    assert photo.camera is not None
    camera = photo.camera
    document = replace(session.document, photos=(*session.document.photos, photo))
    with session.edit("Open a photo"):
        session.replace(document if options.no_pose else pose_from_photo(document, model, photo))
    session.wait()
    posed_errors = residuals_px(photo, model, session.coefficients)
    _print_errors(pins, aligned_errors, posed_errors, model.character.feature_titles)
    origin = "given" if options.focal else "from EXIF" if file.focal else "estimated"
    equivalent = focal_in_mm(camera.focal, file.size)
    print(f"focal length {camera.focal:.0f} px, {equivalent:.0f} mm in 35 mm equivalent ({origin})")
    if options.render is not None:
        from faceposer.render.images import write_png

        write_png(options.render, _comparison(session, photo))
        print(f"{options.render} written")
    session.save(options.output, camera)
    mean = sum(aligned_errors.values()) / len(aligned_errors)
    count = len(session.document.constraints)
    print(
        f"{options.output} written: {counted(len(aligned_errors), 'pin')}, mean error {mean:.1f} px, "
        f"{counted(count, 'constraint')}"
    )
    if mean > _LARGEST_ERROR * _extent([pin for i, pin in enumerate(pins) if i in aligned_errors]):
        print("No camera explains these pins: check the feature point of each pin, and the focal length.")
    return 0


def _check_with_photo(options: argparse.Namespace) -> None:
    """Raise FacePoserError if options that a PHOTO needs are missing, or others are given."""
    if not (options.auto or options.pins):
        raise FacePoserError("Give --auto to find the face in the photo, or its pins with --pins.")
    if options.output is None:
        raise FacePoserError("Give the session to write with -o SESSION.json.")
    changes = (options.pose, options.strength, options.photo_number)
    if options.set or options.add or any(change is not None for change in changes):
        raise FacePoserError(
            "--pose, --strength, --set, --add and --photo-number change a face in the photo of its session; write the "
            "session first, then give it without PHOTO."
        )


def _run_automatic(options: argparse.Namespace) -> int:
    """Take the expression of the face that is found in the photo, and return the exit status."""
    from dataclasses import replace

    from faceposer.cli.opening import print_notes
    from faceposer.photo.automatic import expression_of
    from faceposer.photo.faces import note_of_others, read_face

    found = read_face(options.photo, options.focal)
    print_notes(options.photo, note_of_others(found))
    session = _opened(options)
    taken = expression_of(found, session.model)
    camera = taken.photo.camera
    assert camera is not None
    with session.edit("Open a photo"):
        session.replace(replace(session.document, photos=(*session.document.photos, taken.photo)))
    if not options.no_pose:
        session.rebase_pose(taken.pose, "Take the expression")
    session.wait()
    weights = session.model.weights_of(session.coefficients)
    shown = sorted(zip(session.model.character.shape_names, weights.tolist(), strict=True), key=lambda pair: -pair[1])
    print(", ".join(f"{name} {weight:.2f}" for name, weight in shown[:_SHOWN] if weight >= _LEAST_SHOWN))
    if options.render is not None:
        from faceposer.render.images import write_png

        write_png(options.render, _comparison(session, taken.photo))
        print(f"{options.render} written")
    session.save(options.output, camera)
    print(f"{options.output} written: landmarks {taken.fit.landmark_px(0) * found.factor:.1f} px off the person's head")
    return 0


def _opened(options: argparse.Namespace) -> "Session":
    """Return the session to which the photo is added.

    Raises:
        FacePoserError: If it cannot be opened, or an output is one of its photos.
    """
    from faceposer.cli.opening import open_with_remark

    session = open_with_remark(options.what)
    for path in (options.output, options.render):
        check_not_input(path, *(photo.path for photo in session.document.photos))
    if options.spread is not None:
        session.set_spread(options.spread)
    session.wait()
    return session


def _print_errors(
    pins: Sequence["Pin"], aligned: Mapping[int, float], posed: Mapping[int, float], titles: Mapping[str, str]
) -> None:
    """Print the error of each pin before and after posing, in pixels; ``aligned`` and ``posed`` are keyed by index."""
    for i, pin in enumerate(pins):
        if i in aligned:
            place = pin.place if isinstance(pin.place, str) else "surface point"
            print(f"pin {place:6} {titles.get(place, place):34} {aligned[i]:6.1f} px off, posed {posed[i]:6.1f} px")


def _extent(pins: Sequence["Pin"]) -> float:
    """Return the diagonal of the bounding box of ``pins``, in pixels."""
    us, vs = zip(*(pin.pixel for pin in pins), strict=True)
    return math.hypot(max(us) - min(us), max(vs) - min(vs))


def _comparison(session: "Session", photo: "Photo") -> "NDArray[np.uint8]":
    """Return the photo, the face over it and the face alone side by side, each cropped to the head."""
    import numpy as np

    from faceposer.geometry.picture_view import PictureView
    from faceposer.photo.reading import read_photo
    from faceposer.render.offscreen import render_character

    assert photo.camera is not None
    character = session.model.character
    vertices = session.vertices
    pixels = photo.camera.project(vertices)
    lower, upper = pixels.min(axis=0), pixels.max(axis=0)
    margin = 0.08 * (upper - lower)
    view = PictureView.whole(photo.camera, (0.0, 0.0, 0.0)).showing(lower - margin, upper + margin, _PANEL)
    camera, layer = view.camera(_PANEL), read_photo(Path(photo.path), 4096)
    opacities = ((1.0, 1.0), (1.0, 1.0 - photo.opacity))
    panels = [render_character(character, vertices, camera, photo=(layer, photo.camera, *pair)) for pair in opacities]
    return np.hstack([*panels, render_character(character, vertices, camera)])
