"""``faceposer photo SESSION --render``: puts the face of a session back into its photo."""

import argparse
from typing import TYPE_CHECKING

from faceposer.errors import FacePoserError
from faceposer.files.atomic import check_distinct, check_not_input, check_output

if TYPE_CHECKING:
    from faceposer.api import Face


def render_into_photo(options: argparse.Namespace) -> int:
    """Change the face of the session as ``options`` say, render it into the photo and return the exit status.

    Raises:
        FacePoserError: If an option is missing or wrong, or the session or its photo cannot be used.
    """
    if options.render is None:
        raise FacePoserError("Give a PHOTO, or --render OUT.png to put the face of a session back into its photo.")
    given = [
        name
        for name, value in (
            ("--pins", options.pins),
            ("--auto", options.auto),
            ("--focal", options.focal is not None),
            ("--no-pose", options.no_pose),
        )
        if value
    ]
    if given:
        raise FacePoserError(f"{given[0]} needs a PHOTO; give one after the session.")
    check_output(options.render, ".png")
    if options.output is not None:
        check_output(options.output, ".json")
    # The output may be the input session, which is then as in the picture.
    check_not_input(options.output, options.pose)
    check_not_input(options.render, options.what, options.pose)
    check_distinct(options.output, options.render)
    from faceposer.api import Face
    from faceposer.cli.opening import open_with_remark
    from faceposer.cli.progress_line import ProgressLine
    from faceposer.render.images import write_png
    from faceposer.session.putting_back import photo_with_face

    session = open_with_remark(options.what)
    for path in (options.output, options.render):
        check_not_input(path, *(photo.path for photo in session.document.photos))
    face = Face(session)
    if options.spread is not None:
        face.spread = options.spread
    _change(face, options)
    line = ProgressLine()
    try:
        picture = photo_with_face(session, (options.photo_number or 1) - 1, line.progress)
    finally:
        line.clear()
    write_png(options.render, picture)
    print(f"{options.render} written")
    if options.output is not None:
        session.save(options.output)
        print(f"{options.output} written")
    return 0


def _change(face: "Face", options: argparse.Namespace) -> None:
    """Change pose and head of ``face`` as ``options`` say."""
    from faceposer.cli.identity.heads import values_of

    if options.strength is not None and options.pose is None:
        raise FacePoserError("--strength needs --pose.")
    wanted, added = values_of(options.set, "--set"), values_of(options.add, "--add")
    twice = sorted(wanted.keys() & added.keys())
    if twice:
        raise FacePoserError(f"'{twice[0]}' is given by --set and by --add; give one of them.")
    if wanted or added:
        present = face.attributes
        try:
            # Names that do not exist are reported with the others.
            face.set_attributes(wanted | {name: present.get(name, 0.0) + value for name, value in added.items()})
        except FacePoserError as error:
            known = ", ".join(f"{name} is {present[name]:.2f}" for name in added if name in present)
            raise FacePoserError(
                f"{error} --add changes the present value: {known}." if known else str(error)
            ) from error
    if options.pose is not None:
        face.apply_pose(options.pose, 1.0 if options.strength is None else options.strength)
