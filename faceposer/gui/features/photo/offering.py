"""What becomes of photos that are dropped onto the window: pictures behind the face, or a new character."""

from collections.abc import Sequence
from pathlib import Path

from faceposer.errors import FacePoserError, counted
from faceposer.files.images import FOREIGN_SUFFIXES
from faceposer.gui.features.photo.photos import Photos
from faceposer.gui.features.photo_head.feature import PhotoHeadFeature
from faceposer.gui.features.timeline.feature import TimelineFeature
from faceposer.gui.widgets.dialogs import Choice, Question
from faceposer.photo.reading import PHOTO_SUFFIXES, inspect_photo


def offer_photos(photos: Photos, dropped: Sequence[str]) -> bool:
    """Ask what the ``dropped`` photos shall become; return False if they are no photos, or a dialog is open."""
    context, suffixes = photos.context, (*PHOTO_SUFFIXES, *FOREIGN_SUFFIXES)
    are_photos = [Path(path).suffix.lower() in suffixes for path in dropped]
    if context.is_modal or not are_photos[0]:
        return False
    if not all(are_photos):
        context.dialogs.report(
            "Photos and other files were dropped", "Drop the photos alone, and then each of the other files."
        )
        return True
    context.feature(TimelineFeature).stop()
    context.toolbox.finish()
    context.slider_edit.let_go()
    if context.busy:
        return False
    usable: list[Path] = []
    problems: list[str] = []
    for path in map(Path, dropped):
        try:
            inspect_photo(path)
        except FacePoserError as error:
            problems.append(str(error))
        else:
            usable.append(path)
    if problems:
        more = f" {len(problems) - 1} more cannot be opened either." if len(problems) > 1 else ""
        context.dialogs.report("The photo cannot be opened", f"{problems[0]}{more}")
    if usable:
        context.dialogs.ask(_question(photos, usable))
    return True


def _question(photos: Photos, paths: Sequence[Path]) -> Question:
    several = len(paths) > 1
    them, person = ("them", "the person in them") if several else ("it", "the person in it")
    title = photos.context.session.model.character.title

    def show() -> None:
        for path in paths:
            photos.open(path)

    return Question(
        counted(len(paths), "photo") if several else paths[0].name,
        f"Show {them} behind the face of {title}, to pose {title} after {them}, or make a new character of {person}?",
        (
            Choice("Behind the face", show),
            Choice("Head from photos...", lambda: make_head(photos, paths)),
            Choice("Cancel"),
        ),
    )


def make_head(photos: Photos, paths: Sequence[Path]) -> None:
    """Open the dialog that makes a character of the person in the photos ``paths``."""
    head = photos.context.feature(PhotoHeadFeature)
    head.show()
    for path in paths:
        head.add(path)
