"""Photos to pose the face from: the active photo, its texture, and the commands of the tab."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from imgui_bundle import imgui

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.files.images import FOREIGN_SUFFIXES
from faceposer.geometry.picture_view import PictureView
from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.photo.actions import photo_actions
from faceposer.gui.features.photo.expression import TakeExpression
from faceposer.gui.features.photo.overlay import draw_photo_overlay
from faceposer.gui.features.photo.panel import draw_photo_tab
from faceposer.gui.features.photo.putting_back import PuttingBack
from faceposer.gui.features.photo.textures import PhotoTextures
from faceposer.gui.settings import last_folder
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.model.character import ARKIT_SHAPES
from faceposer.photo.aligning import aligned, first_camera
from faceposer.photo.photo import MAX_PHOTOS, Photo, Place
from faceposer.photo.reading import PHOTO_SUFFIXES, inspect_photo, read_photo
from faceposer.render.renderer import PhotoLayer
from faceposer.session.photos import pose_from_photo, with_photo
from faceposer.solve.camera_fit import LEAST_POINTS
from faceposer.tools.photo_tool import PhotoTool

# Rotation of the view in radians over which the photo fades.
_FADE = 0.25
# Share of the view's height below which a head is small.
_SMALL = 0.5
# Least opacity of the photo over the face while pins are set.
_LEAST_PINNING_OPACITY = 0.7


def _photo_problem(photo: Photo) -> str:
    """Return the reason why ``photo`` cannot be shown as it was pinned, or ""."""
    try:
        size = inspect_photo(Path(photo.path)).size
    except FacePoserError as error:
        return f"{error} Restore the file, or remove the photo in the tab Photo."
    if size == photo.size:
        return ""
    found, pinned = ("x".join(map(str, sides)) for sides in (size, photo.size))
    return f"The photo '{photo.path}' has {found} pixels, but was pinned at {pinned}. Restore the original file."


class PhotoFeature(Feature):
    """The tab "Photo", and the photo in the view."""

    tab = ("Photo", "Pose the face from a photo, aligned by pins")

    def __init__(self, context: EditorContext) -> None:
        """Serve ``context``; photos are read when they are first shown."""
        super().__init__(context)
        self._textures = PhotoTextures()
        # Path of the photo and its number of pins in the last frame.
        self._last_pin_count = ("", 0)
        # Path of the photo and places of its pins in the last frame, and the revision of the session.
        self._last_pins: tuple[str, tuple[Place, ...], int] = ("", (), -1)
        # True if the photo has to be framed as soon as the view has a size.
        self._framing_pending = False
        self.expression = TakeExpression(context, self.look_through)
        self.putting_back = PuttingBack(context)

    # State

    @property
    def photos(self) -> tuple[Photo, ...]:
        """The photos of the session."""
        return self.context.session.document.photos

    @property
    def traced(self) -> bool:
        """True with a photo: the tools then draw over it."""
        return bool(self.photos)

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

    def actions(self) -> Sequence[Action | Submenu]:
        """Return its menu entries."""
        return photo_actions(self)

    @property
    def has_enough_pins(self) -> bool:
        """True if the photo has enough pins to determine its camera."""
        return self.photo is not None and len(self.photo.pins) >= LEAST_POINTS

    @property
    def _pinning(self) -> bool:
        return self.context.toolbox.chosen is self.tool and (self.tool.place is not None or self.context.toolbox.active)

    # The loop

    def session_changed(self) -> None:
        """Look through the photo that the session was saved with, and report missing files."""
        # Files may have changed on disk.
        self.context.scene.photo = None
        self._textures.release()
        self.putting_back.forget()
        view, camera = self.context.viewport.view, self.context.viewport.camera
        matching = [i for i, photo in enumerate(self.photos) if photo.camera and photo.camera.same_viewpoint(camera)]
        self.tool.active = matching[0] if matching else 0 if self.photos else None
        # A session that returns has its view already; that of a file can be orbited.
        self._framing_pending = bool(matching) and not (isinstance(view, PictureView) and view.locked)
        problems = [problem for problem in map(_photo_problem, self.photos) if problem]
        if problems:
            more = f" {len(problems) - 1} more cannot be shown either." if len(problems) > 1 else ""
            self.context.dialogs.report("A photo cannot be shown", f"{problems[0]}{more}")

    def update(self) -> None:
        """Keep the view at the photo's camera, such as after undo, and update the photo layer of the scene."""
        viewport, scene = self.context.viewport, self.context.scene
        self.expression.update()
        if self.tool.active is not None and self.active is None:
            self.tool.active = len(self.photos) - 1 if self.photos else None
            if not self.photos and isinstance(viewport.view, PictureView):
                viewport.view = viewport.framed()
                if self.context.toolbox.chosen is self.tool:
                    self.context.toolbox.choose("point")
        if self._framing_pending and self.photo is not None and viewport.size != (1, 1):
            self._framing_pending = False
            self._look_through(self.photo, reset=True)
        self._adopt_view_camera()
        self._follow_undo()
        photo, view = self.photo, viewport.view
        layer = None
        if photo is not None and isinstance(view, PictureView) and view.photo.size == photo.size:
            camera = photo.camera or first_camera(photo, self.context.session.model)
            if view.photo != camera:
                view = viewport.view = view.through(camera)
            self._suggest_framing(photo)
            texture = self._textures.texture(self.context.gl, photo.path) if photo.visible else None
            if texture is not None:
                near = max(1.0 - max(abs(view.yaw), abs(view.pitch)) / _FADE, 0.0)
                opacity = photo.opacity
                if self._pinning:
                    # The photo must be visible while pins are set.
                    least = _LEAST_PINNING_OPACITY
                    opacity = max(opacity, least) if photo.front else min(opacity, 1.0 - least)
                behind, before = (0.0, opacity) if photo.front else (1.0, 1.0 - opacity)
                before = before if view.aligned else 0.0
                changed = self.putting_back.picture(photo)
                if changed is not None and view.aligned and not self._pinning:
                    texture, behind, before = changed, 0.0, 1.0
                layer = PhotoLayer(texture, photo.size, camera.focal, near * behind, near * before)
        if layer != scene.photo:
            scene.photo = layer
            self.context.redraw()
        # Released here rather than when a texture is added, because this frame may still draw it.
        self._textures.trim(kept="" if photo is None else photo.path)

    def _follow_undo(self) -> None:
        """Ask for the place of a pin again that was undone."""
        photo, session = self.photo, self.context.session
        if photo is None or self.context.toolbox.active or session.revision == self._last_pins[2]:
            return
        path, before, _ = self._last_pins
        self._last_pins = (photo.path, tuple(pin.place for pin in photo.pins), session.revision)
        if path == photo.path and self.context.toolbox.chosen is self.tool:
            self.tool.follow_pins(before, self.context.viewport)

    def _adopt_view_camera(self) -> None:
        """Activate the photo that has the camera of the view, such as after going to a constraint's view."""
        view = self.context.viewport.view
        if not isinstance(view, PictureView) or (self.photo is not None and view.photo.size == self.photo.size):
            return
        for i, photo in enumerate(self.photos):
            if photo.camera is not None and photo.camera.same_viewpoint(view.photo):
                self.tool.active = i
                self._look_through(photo)

    def _suggest_framing(self, photo: Photo) -> None:
        """Suggest once to frame a head that is small in the photo, as soon as it is aligned."""
        context, before = self.context, self._last_pin_count
        self._last_pin_count = (photo.path, len(photo.pins))
        if context.toolbox.active:
            self._last_pin_count = before
        elif before == (photo.path, LEAST_POINTS - 1) and len(photo.pins) == LEAST_POINTS:
            head = context.viewport.camera.project(context.scene.vertices)
            if float(np.ptp(head[:, 1])) < _SMALL * context.viewport.size[1]:
                context.notify(f"Press {context.actions['frame'].shortcut} to zoom in on the head")

    @property
    def readable(self) -> bool:
        """True if the file of the active photo could be read."""
        return self.photo is not None and self._textures.texture(self.context.gl, self.photo.path) is not None

    def join(self) -> None:
        """Wait for the face that is being found."""
        self.expression.join()
        self.putting_back.join()

    def close(self) -> None:
        """Release the textures."""
        self.context.scene.photo = None
        self._textures.release()
        self.putting_back.forget()

    # Drawing

    def draw_tab(self) -> None:
        """Draw the tab."""
        draw_photo_tab(self)

    def draw_behind(self, draw: imgui.ImDrawList) -> None:
        """Draw the pins of the photo."""
        draw_photo_overlay(self.context, draw)

    # Commands

    def ask(self) -> None:
        """Ask for a photo file and open it."""
        folder = Path(self.photos[-1].path).parent if self.photos else last_folder(self.context.settings)
        start = folder if paths.can_enter(folder) else last_folder(self.context.settings)
        self.context.ask_for_file(FileRequest("open", "Open photo", "Photos", PHOTO_SUFFIXES, start, self.open))

    def accept_files(self, dropped: tuple[str, ...]) -> bool:
        """Open dropped files if all of them are images."""
        suffixes = (*PHOTO_SUFFIXES, *FOREIGN_SUFFIXES)
        if (
            self.context.is_modal
            or self.context.busy
            or not all(Path(path).suffix.lower() in suffixes for path in dropped)
        ):
            return False
        for path in dropped:
            self.open(Path(path))
        return True

    def open(self, path: Path) -> None:
        """Add the photo ``path`` to the session as one step of the history, look through it and start pinning."""
        context = self.context
        path = paths.absolute(paths.expand_user(path))
        try:
            file = inspect_photo(path)
            if len(self.photos) >= MAX_PHOTOS:
                raise FacePoserError(f"A session has at most {MAX_PHOTOS} photos; remove one first.")
            read_photo(path, 64)
        except FacePoserError as error:
            context.dialogs.report("The photo cannot be opened", str(error))
            return
        photo = Photo(str(path), file.size, focal=file.focal)
        photo = replace(photo, camera=first_camera(photo, context.session.model))
        context.toolbox.finish()
        with context.session.edit("Open a photo"):
            document = context.session.document
            context.session.replace(replace(document, photos=(*document.photos, photo)))
        context.dismiss_guide()
        self.choose(len(self.photos) - 1)
        self.start_pinning()

    def choose(self, index: int) -> None:
        """Activate photo ``index`` and look through it."""
        if self.context.toolbox.active:
            return
        self.tool.active, self.tool.selected = index, None
        self._look_through(self.photos[index])
        if self.context.toolbox.chosen is self.tool:
            self.tool.place = self.tool.next_place(self.context.viewport)

    def look_through(self) -> None:
        """Look through the camera of the active photo."""
        if self.photo is not None:
            self._look_through(self.photo)

    def _look_through(self, photo: Photo, reset: bool = False) -> None:
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
        self.look_through()
        self.context.toolbox.choose(self.tool.name)
        self.tool.place = self.tool.next_place(self.context.viewport)

    def skip(self) -> None:
        """Skip to the next place."""
        self.tool.skip(self.context.viewport)

    def pin_place(self, place: Place) -> None:
        """Set a pin for ``place`` with the next press on the photo."""
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
        return not set(ARKIT_SHAPES).isdisjoint(self.context.session.model.character.shape_names)

    def take_expression(self) -> None:
        """Pose the face after the active photo without pins; constraints are removed."""
        if self.photo is not None:
            self.context.toolbox.finish()
            self.context.toolbox.choose("point")
            self.expression.start(self.photo)

    @property
    def can_put_back(self) -> bool:
        """True if it is known how the active photo shows the face, so that the face can be put back into it."""
        return self.photo is not None and self.putting_back.possible(self.photo)

    def save_picture(self) -> None:
        """Ask for a file, and write the photo with the face as it is now to it."""
        if self.photo is not None:
            self.putting_back.ask_for_file(self.photo)

    def pose_from_pins(self) -> None:
        """Pose the face from the pins as one step of the history; constraints made from them before are replaced."""
        photo, session = self.photo, self.context.session
        if photo is None or not self.has_enough_pins:
            return
        self.context.toolbox.finish()
        with session.edit("Pose from the photo"):
            session.replace(pose_from_photo(session.document, session.model, photo))
