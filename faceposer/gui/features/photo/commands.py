"""The photos of the session: the active one, and the commands of the tab and the menus."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.geometry.picture_view import PictureView
from faceposer.gui.context import EditorContext
from faceposer.gui.features.photo.expression import TakeExpression
from faceposer.gui.features.photo.offering import make_head
from faceposer.gui.features.photo.putting_back import PuttingBack
from faceposer.gui.features.photo.textures import PhotoTextures
from faceposer.gui.features.photo.wipe import Wipe
from faceposer.gui.settings import last_folder
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.shape_names import weight_map
from faceposer.photo.aligning import aligned, first_camera
from faceposer.photo.photo import MAX_PHOTOS, Photo, Place
from faceposer.photo.reading import PHOTO_SUFFIXES, inspect_photo, read_photo
from faceposer.session.photos import pose_from_photo, with_photo
from faceposer.solve.camera_fit import LEAST_POINTS
from faceposer.tools.photo_tool import PhotoTool


@lru_cache(maxsize=8)
def _takes(shapes: tuple[str, ...]) -> bool:
    """Return True if a character with ``shapes`` can be given the expression of a photo."""
    return bool(weight_map(shapes, ARKIT_SHAPES).any())


class PhotoCommands:
    """The photos of the session, as the tab and the actions know them (`Photos`).

    Attributes:
        context: The editor.
        textures: Textures of the photos.
        expression: The expression of a photo, found in the background.
        putting_back: The photo with the face as it is now.
        wipe: The line between photo and face.
    """

    def __init__(self, context: EditorContext) -> None:
        """Serve ``context``; photos are read when they are first shown."""
        self.context = context
        self.textures = PhotoTextures()
        self.expression = TakeExpression(context, self.look_through)
        self.putting_back = PuttingBack(context)
        self.wipe = Wipe(context)

    # State

    @property
    def photos(self) -> tuple[Photo, ...]:
        """The photos of the session."""
        return self.context.session.document.photos

    @property
    def tool(self) -> PhotoTool:
        """The tool that sets pins."""
        return self.context.toolbox.photo_tool

    @property
    def active(self) -> int | None:
        """Index of the active photo, which the tab shows, or None."""
        index = self.tool.active
        return index if index is not None and index < len(self.photos) else None

    @property
    def photo(self) -> Photo | None:
        """The active photo, or None."""
        return None if self.active is None else self.photos[self.active]

    @property
    def aligned(self) -> bool:
        """True if the view shows the photo and the face from the photo's camera."""
        view = self.context.viewport.view
        return self.photo is not None and isinstance(view, PictureView) and view.aligned

    @property
    def has_enough_pins(self) -> bool:
        """True if the photo has enough pins to determine its camera."""
        return self.photo is not None and len(self.photo.pins) >= LEAST_POINTS

    @property
    def pinning(self) -> bool:
        """True while pins are set one after another, or one is dragged."""
        return self.context.toolbox.chosen is self.tool and (self.tool.place is not None or self.context.toolbox.active)

    @property
    def readable(self) -> bool:
        """True if the file of the active photo could be read."""
        return self.photo is not None and self.textures.texture(self.context.gl, self.photo.path) is not None

    # Commands

    def ask(self) -> None:
        """Ask for a photo file and open it."""
        self._ask(lambda: None)

    def ask_and_take_expression(self) -> None:
        """Ask for a photo file, open it, and pose the face after it without pins."""
        self._ask(self.take_expression)

    def ask_and_pin(self) -> None:
        """Ask for a photo file, open it, and start to set pins."""
        self._ask(self.start_pinning)

    def _ask(self, then: Callable[[], None]) -> None:
        folder = Path(self.photos[-1].path).parent if self.photos else last_folder(self.context.settings)
        start = folder if paths.can_enter(folder) else last_folder(self.context.settings)

        def done(path: Path) -> None:
            if self.open(path):
                then()

        self.context.ask_for_file(FileRequest("open", "Open photo", "Photos", PHOTO_SUFFIXES, start, done))

    def make_head(self, paths: Sequence[Path] = ()) -> None:
        """Open the dialog that makes a character of the person in the photos ``paths``."""
        make_head(self, paths)

    def open(self, path: Path) -> bool:
        """Add the photo ``path`` to the session as one step of the history and look through it; True if it is open.

        A photo that the session has already is only chosen.
        """
        context = self.context
        path = paths.absolute(paths.expand_user(path))
        context.toolbox.finish()
        known = next((i for i, photo in enumerate(self.photos) if paths.same_file(path, photo.path)), None)
        if known is None:
            try:
                file = inspect_photo(path)
                if len(self.photos) >= MAX_PHOTOS:
                    raise FacePoserError(f"A session has at most {MAX_PHOTOS} photos; remove one first.")
                read_photo(path, 64)
            except FacePoserError as error:
                context.dialogs.report("The photo cannot be opened", str(error))
                return False
            photo = Photo(str(path), file.size, focal=file.focal)
            photo = replace(photo, camera=first_camera(photo, context.session.model))
            with context.session.edit("Open a photo"):
                document = context.session.document
                context.session.replace(replace(document, photos=(*document.photos, photo)))
            known = len(self.photos) - 1
        context.dismiss_guide()
        context.show_tab("Photo")
        self.choose(known)
        return True

    def choose(self, index: int) -> None:
        """Activate photo ``index`` and look through it."""
        if self.context.toolbox.active:
            return
        self.tool.active, self.tool.selected = index, None
        self.look_through_photo(self.photos[index])
        if self.context.toolbox.chosen is self.tool:
            self.tool.place = self.tool.next_place(self.context.viewport)

    def look_through(self) -> None:
        """Look through the camera of the active photo."""
        if self.photo is not None:
            self.look_through_photo(self.photo)

    def look_through_photo(self, photo: Photo, reset: bool = False) -> None:
        """Look through the camera of ``photo``; show all of it, unless the view is at that camera and not ``reset``."""
        viewport, session = self.context.viewport, self.context.session
        if not reset and isinstance(viewport.view, PictureView) and viewport.view.photo == photo.camera:
            viewport.view = viewport.view.back()
            return
        x, y, z = session.model.character.vertices.mean(axis=0).tolist()
        before, locked = viewport.view, True
        if not reset and isinstance(before, PictureView):
            locked = before.locked or all(before.photo.size != other.size for other in self.photos)
        view = PictureView.whole(photo.camera or first_camera(photo, session.model), (x, y, z))
        viewport.view = replace(view, locked=locked)
        self.context.redraw()

    def start_pinning(self) -> None:
        """Choose the tool that sets pins, at the first place without a pin."""
        self.putting_back.switch(False)
        self.look_through()
        self.context.toolbox.choose(self.tool.name)
        self.tool.place = self.tool.next_place(self.context.viewport)

    def skip(self) -> None:
        """Skip to the next place."""
        self.tool.skip(self.context.viewport)

    def pin_place(self, place: Place) -> None:
        """Set a pin for ``place`` with the next press on the photo."""
        self.putting_back.switch(False)
        self.look_through()
        self.context.toolbox.choose(self.tool.name)
        self.tool.place = place

    def toggle(self) -> None:
        """Show or hide the photo."""
        if self.photo is not None:
            self.change(replace(self.photo, visible=not self.photo.visible), "Show or hide the photo")

    def change(self, photo: Photo, label: str, merges: bool = False) -> None:
        """Replace the active photo by ``photo``, as one step of the history or within the edit of a slider."""
        session, index = self.context.session, self.active
        assert index is not None
        before = session.document.photos[index]
        if (photo.opacity, photo.front, photo.visible) != (before.opacity, before.front, before.visible):
            # Photo and face are to be seen.
            self.putting_back.switch(False)
        if photo.opacity != before.opacity:
            self.wipe.on = False
        document = with_photo(session.document, index, photo)
        if session.editing:
            session.replace(document)
            return
        with session.edit(label, merges):
            session.replace(document)

    def realign(self, focal: float | None) -> None:
        """Fit the camera again with the focal length ``focal`` in pixels, or estimate it if None."""
        photo, session = self.photo, self.context.session
        if photo is not None:
            try:
                changed = aligned(replace(photo, focal=focal), session.model, session.coefficients)
            except FacePoserError as error:
                self.context.dialogs.report("The photo cannot be aligned", str(error))
                return
            self.change(changed, "Align the photo")

    def remove(self, index: int) -> None:
        """Remove photo ``index`` from the session as one step of the history; its file is kept."""
        session = self.context.session
        document = session.document
        with session.edit("Remove a photo"):
            session.replace(replace(document, photos=(*document.photos[:index], *document.photos[index + 1 :])))
        if self.photos:
            self.choose(min(self.active or 0, len(self.photos) - 1))

    @property
    def takes_expressions(self) -> bool:
        """True if the character has shapes of ARKit, to which the expression of a photo is given."""
        return _takes(self.context.session.model.character.shape_names)

    def take_expression(self) -> None:
        """Pose the face after the active photo without pins; constraints are removed."""
        if self.photo is not None:
            self.putting_back.switch(False)
            self.context.toolbox.finish()
            self.context.toolbox.choose("point")
            self.expression.start(self.photo)

    @property
    def put_back_problem(self) -> str:
        """Why the face cannot be put back into the active photo, and what to do, one sentence; "" if it can."""
        photo = self.photo
        if photo is None:
            return "Open a photo first."
        if self.putting_back.possible(photo):
            return "" if self.readable else "The file of the photo cannot be read."
        if self.takes_expressions:
            pins = "; pins alone do not tell" if photo.pins else ""
            return f"Take the expression first: it is not known yet how the photo shows the face{pins}."
        title = self.context.session.model.character.title
        return (
            f"{title} has none of ARKit's shapes, by which it is known how a photo shows a face; use another character."
        )

    def put_back(self) -> None:
        """Show the photo with the face put back, seen through its camera, or photo and face again."""
        if self.putting_back.on or self.photo is None:
            self.putting_back.switch(False)
            return
        self._show_photo()
        self.putting_back.switch(True)

    def toggle_wipe(self) -> None:
        """Divide the view by a line between photo and face, seen through the photo's camera, or no longer."""
        if not self.wipe.on:
            self._show_photo()
        self.wipe.toggle()

    def _show_photo(self) -> None:
        """Show the photo without the tool that sets pins, seen through its camera."""
        if self.photo is not None and not self.photo.visible:
            self.toggle()
        if self.pinning:
            self.context.toolbox.choose("point")
        if not self.aligned:
            self.look_through()

    def pose_from_pins(self) -> None:
        """Pose the face from the pins as one step of the history; constraints made from them before are replaced."""
        photo, session = self.photo, self.context.session
        if photo is None or not self.has_enough_pins:
            return
        self.putting_back.switch(False)
        self.context.toolbox.finish()
        with session.edit("Pose from the photo"):
            session.replace(pose_from_photo(session.document, session.model, photo))
