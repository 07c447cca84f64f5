"""``faceposer photo``: aligns the camera of a photo by pins and poses the face after it."""

import argparse
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from faceposer.cli.arguments import add_spread
from faceposer.errors import FacePoserError, printable
from faceposer.files.atomic import check_apart, check_output

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from faceposer.photo.photo import Photo, Pin
    from faceposer.session.session import Session

NAME = "photo"
# Of each panel of the picture.
_PANEL = (480, 600)
_CHECKED_SIDE = 1024
# Share of the pins' spread beyond which they tell no view of the face.
_HOPELESS = 0.15


def add_parser(commands: Any) -> None:
    """Add the parser."""
    parser = commands.add_parser(
        NAME,
        help="pose a face after a photo",
        description="Find the camera of a photo by pins, pose the face after it and write the session.",
    )
    parser.add_argument("what", metavar="CHARACTER|SESSION", help="the face; a session keeps what it has")
    parser.add_argument("photo", type=Path, metavar="PHOTO", help="JPEG, PNG or another common picture")
    parser.add_argument("--pins", type=Path, metavar="PINS.json", required=True, help="pins (docs/photo.md)")
    parser.add_argument("-o", "--output", type=Path, metavar="SESSION.json", required=True, help="session to write")
    parser.add_argument("--focal", type=float, metavar="PX", help="focal length in pixels; else by EXIF, or found")
    add_spread(parser, "as the session has it, else 0.5")
    parser.add_argument("--no-pose", action="store_true", help="only align the camera")
    parser.add_argument("--render", type=Path, metavar="OUT.png", help="also draw photo, face over photo, and face")


def run(options: argparse.Namespace) -> int:
    """Do it and return the exit status."""
    check_output(options.output, ".json")
    if options.render is not None:
        check_output(options.render, ".png")
    # The session may be the one that gets the photo.
    check_apart(options.output, options.photo, options.pins)
    check_apart(options.render, options.photo)
    if options.focal is not None and not 1.0 <= options.focal <= 1e6:
        raise FacePoserError("The focal length must be from 1 to 1,000,000 pixels.")
    from dataclasses import replace

    from faceposer.cli.opening import open_with_remark
    from faceposer.photo.aligning import aligned, residuals_px
    from faceposer.photo.photo import Photo
    from faceposer.photo.pins_file import read_pins
    from faceposer.photo.reading import focal_in_mm, inspect_photo, read_photo
    from faceposer.session.photos import with_expression
    from faceposer.solve.camera_fit import LEAST_POINTS

    file = inspect_photo(options.photo)
    # Decoded once, so that a damaged file is told before anything is written.
    read_photo(options.photo, _CHECKED_SIDE)
    pins = read_pins(options.pins)
    _check_pins(options.pins, pins, file.size)
    session = _with_spread(open_with_remark(options.what), options.spread)
    model = session.model
    path = str(options.photo.absolute())
    photo = aligned(Photo(path, file.size, pins, focal=options.focal or file.focal), model, session.coefficients)
    off = residuals_px(photo, model, session.coefficients)
    for pin in (pin for i, pin in enumerate(pins) if i not in off):
        print(printable(f"pin {pin.place}: the face has no such place"))
    if len(off) < LEAST_POINTS:
        raise FacePoserError(
            f"'{options.pins}' pins {len(off)} places that the face has; its camera takes {LEAST_POINTS}, better 8."
        )
    assert photo.camera is not None
    camera = photo.camera
    document = replace(session.document, photos=(*session.document.photos, photo))
    with session.edit("Open a photo"):
        session.replace(document if options.no_pose else with_expression(document, model, photo))
    session.wait()
    after = residuals_px(photo, model, session.coefficients)
    _tell(pins, off, after, model.character.feature_titles)
    how = "given" if options.focal else "by EXIF" if file.focal else "found, or likely"
    print(f"focal length {camera.focal:.0f} px, {focal_in_mm(camera.focal, file.size):.0f} mm on 35 mm film ({how})")
    if options.render is not None:
        from faceposer.render.images import write_png

        write_png(options.render, _picture(session, photo))
        print(f"{options.render} written")
    session.save(options.output, camera)
    mean = sum(off.values()) / len(off)
    told = len(session.document.constraints)
    print(f"{options.output} written: {len(off)} pins, {mean:.1f} px off on average, {told} constraints")
    if mean > _HOPELESS * _spread([pin for i, pin in enumerate(pins) if i in off]):
        print("No view of the face shows these pins: check that each names what it lies on, and the focal length.")
    return 0


def _with_spread(session: "Session", spread: float | None) -> "Session":
    if spread is not None:
        session.set_spread(spread)
    session.wait()
    return session


def _check_pins(path: Path, pins: Sequence["Pin"], size: tuple[int, int]) -> None:
    for i, (u, v) in enumerate(pin.pixel for pin in pins):
        if not (0.0 <= u <= size[0] and 0.0 <= v <= size[1]):
            raise FacePoserError(
                f"The pins '{path}' have pins[{i}] at ({u:g}, {v:g}), outside of the photo of {size[0]} x {size[1]} "
                "pixels; give its place in pixels from the top left."
            )


def _tell(
    pins: Sequence["Pin"], off: Mapping[int, float], after: Mapping[int, float], titles: Mapping[str, str]
) -> None:
    for i, pin in enumerate(pins):
        if i in off:
            place = pin.place if isinstance(pin.place, str) else "of the surface"
            print(f"pin {place:6} {titles.get(place, place):34} {off[i]:6.1f} px off, posed {after[i]:6.1f} px")


def _spread(pins: Sequence["Pin"]) -> float:
    """Return the diagonal of the box around ``pins``, in pixels."""
    us, vs = zip(*(pin.pixel for pin in pins), strict=True)
    return math.hypot(max(us) - min(us), max(vs) - min(vs))


def _picture(session: "Session", photo: "Photo") -> "NDArray[np.uint8]":
    """Return the photo, the face over it and the face, each cut to the head, side by side."""
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
    layers = ((1.0, 1.0), (1.0, 1.0 - photo.opacity))
    shown = [render_character(character, vertices, camera, photo=(layer, photo.camera, *both)) for both in layers]
    return np.hstack([*shown, render_character(character, vertices, camera)])
