"""Photos that the face is posed after: which is looked through, its picture, and what the user does to it."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
from imgui_bundle import imgui

from faceposer.errors import FacePoserError
from faceposer.geometry.picture_view import PictureView
from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.photo.actions import photo_actions
from faceposer.gui.features.photo.overlay import draw_photo_overlay
from faceposer.gui.features.photo.panel import draw_photo_tab
from faceposer.gui.settings import last_folder
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.photo.aligning import aligned, first_camera
from faceposer.photo.photo import MAX_PHOTOS, Photo, Place
from faceposer.photo.reading import FOREIGN_SUFFIXES, PHOTO_SUFFIXES, inspect_photo, read_photo
from faceposer.render.offscreen import photo_texture
from faceposer.render.renderer import PhotoLayer
from faceposer.session.photos import with_expression, with_photo
from faceposer.solve.camera_fit import LEAST_POINTS
from faceposer.tools.photo_tool import PhotoTool

# The longer side of a picture on the GPU: what an ordinary card takes, and more than a display shows.
_LARGEST = 4096
# Radians of a turn away from the photo over which it fades.
_FADE = 0.25
# Share of the view's height below which a head is small.
_SMALL = 0.5
# Pictures on the GPU: to go from one photo to the next takes no time.
_MOST_PICTURES = 4
# Least opacity of the photo over the face while pins are set.
_PINNING = 0.7


def _trouble(photo: Photo) -> str:
    """Return why ``photo`` cannot be shown as it was pinned, or ""."""
    try:
        size = inspect_photo(Path(photo.path)).size
    except FacePoserError as error:
        return f"{error} Put it there, or take it out in the tab Photo."
    if size == photo.size:
        return ""
    found, known = ("x".join(map(str, sides)) for sides in (size, photo.size))
    return f"the photo '{photo.path}' has {found} pixels, and was pinned at {known}; put the old one back."


class PhotoFeature(Feature):
    """The tab "Photo", and the photo in the view."""

    tab = ("Photo", "Pose the face after a photo: pins let the camera find where the photo was taken from")

    def __init__(self, context: EditorContext) -> None:
        """Serve ``context``; photos are read when they are looked through."""
        super().__init__(context)
        self._pictures: dict[str, moderngl.Texture | None] = {}
        self._pins = ("", 0)
        self._fresh = False

    # What there is

    @property
    def photos(self) -> tuple[Photo, ...]:
        """The photos of the session."""
        return self.context.session.document.photos

    @property
    def tool(self) -> PhotoTool:
        """What sets pins."""
        return self.context.toolbox.photo_tool

    @property
    def active(self) -> int | None:
        """Index of the photo that the tab is about, or None."""
        index = self.tool.active
        return index if index is not None and index < len(self.photos) else None

    @property
    def photo(self) -> Photo | None:
        """The photo that the tab is about, or None."""
        return None if self.active is None else self.photos[self.active]

    @property
    def looking(self) -> bool:
        """Whether the view looks through the photo, or is turned away from it."""
        return self.photo is not None and isinstance(self.context.viewport.view, PictureView)

    @property
    def aligned(self) -> bool:
        """Whether the view shows the photo and the face as its camera saw them."""
        view = self.context.viewport.view
        return self.photo is not None and isinstance(view, PictureView) and view.aligned

    def actions(self) -> Sequence[Action | Submenu]:
        """Return its menu entries."""
        return photo_actions(self)

    @property
    def enough(self) -> bool:
        """Whether the photo has the pins that its camera takes."""
        return self.photo is not None and len(self.photo.pins) >= LEAST_POINTS

    @property
    def _pinning(self) -> bool:
        return self.context.toolbox.chosen is self.tool and (self.tool.place is not None or self.context.toolbox.active)

    # Turns of the loop

    def session_changed(self) -> None:
        """Look through the photo that the session was last seen through, and say which files are missing."""
        # A file may have changed since.
        self.context.scene.photo = None
        self._release()
        camera = self.context.viewport.camera
        found = [i for i, photo in enumerate(self.photos) if photo.camera and photo.camera.same_viewpoint(camera)]
        self.tool.active = found[0] if found else 0 if self.photos else None
        self._fresh = bool(found)
        troubles = [trouble for trouble in map(_trouble, self.photos) if trouble]
        if troubles:
            more = f" So it is with {len(troubles) - 1} more." if len(troubles) > 1 else ""
            self.context.dialogs.report("A photo cannot be shown", f"The session is open, but: {troubles[0]}{more}")

    def update(self) -> None:
        """Keep the view at the photo's camera, as after an undo, and give the scene what lies behind the face."""
        viewport, scene = self.context.viewport, self.context.scene
        if self.tool.active is not None and self.active is None:
            self.tool.active = len(self.photos) - 1 if self.photos else None
            if not self.photos and isinstance(viewport.view, PictureView):
                viewport.view = viewport.framed()
                if self.context.toolbox.chosen is self.tool:
                    self.context.toolbox.choose("point")
        if self._fresh and self.photo is not None and viewport.size != (1, 1):
            # As soon as it is known how large the view is.
            self._fresh = False
            self._look(self.photo, afresh=True)
        self._recognise()
        photo, view = self.photo, viewport.view
        layer = None
        if photo is not None and isinstance(view, PictureView) and view.photo.size == photo.size:
            camera = photo.camera or first_camera(photo, self.context.session.model)
            if view.photo != camera:
                view = viewport.view = view.through(camera)
            self._suggest_coming_near(photo)
            texture = self._texture(photo) if photo.visible else None
            if texture is not None:
                near = max(1.0 - max(abs(view.yaw), abs(view.pitch)) / _FADE, 0.0)
                opacity = photo.opacity
                if self._pinning:
                    # Who sets pins has to see the photo.
                    opacity = max(opacity, _PINNING) if photo.front else min(opacity, 1.0 - _PINNING)
                behind, before = (0.0, opacity) if photo.front else (1.0, 1.0 - opacity)
                before = before if view.aligned else 0.0
                layer = PhotoLayer(texture, photo.size, camera.focal, near * behind, near * before)
        if layer != scene.photo:
            scene.photo = layer
            self.context.redraw()
        if len(self._pictures) > _MOST_PICTURES:
            # Here and not where one is taken up: what is drawn in this frame must stay.
            self._release(kept="" if photo is None else photo.path)

    def _recognise(self) -> None:
        """Look through the photo whose camera the view has taken up, as from a constraint that was drawn through it."""
        view = self.context.viewport.view
        if not isinstance(view, PictureView) or (self.photo is not None and view.photo.size == self.photo.size):
            return
        for i, photo in enumerate(self.photos):
            if photo.camera is not None and photo.camera.same_viewpoint(view.photo):
                self.tool.active = i
                self._look(photo)

    def _suggest_coming_near(self, photo: Photo) -> None:
        """Say once how to bring a small head near, when it is known where it is: pins are set more exactly there."""
        context, before = self.context, self._pins
        self._pins = (photo.path, len(photo.pins))
        if context.toolbox.active:
            self._pins = before
        elif before == (photo.path, LEAST_POINTS - 1) and len(photo.pins) == LEAST_POINTS:
            head = context.viewport.camera.project(context.scene.vertices)
            if float(np.ptp(head[:, 1])) < _SMALL * context.viewport.size[1]:
                context.notify(f"{context.actions['frame'].shortcut} brings the head nearer")

    def _texture(self, photo: Photo) -> moderngl.Texture | None:
        """Return the picture of ``photo`` on the GPU, or None where its file cannot be read."""
        if photo.path not in self._pictures:
            # One that cannot be read is not tried again in every frame.
            self._pictures[photo.path] = None
            with suppress(FacePoserError):
                pixels = read_photo(Path(photo.path), _LARGEST)
                self._pictures[photo.path] = photo_texture(self.context.gl, pixels)
        return self._pictures[photo.path]

    @property
    def readable(self) -> bool:
        """Whether the file of the photo could be read."""
        return self.photo is not None and self._texture(self.photo) is not None

    def _release(self, kept: str = "") -> None:
        for path in [path for path in self._pictures if path != kept]:
            texture = self._pictures.pop(path)
            if texture is not None:
                texture.release()

    def close(self) -> None:
        """Free the picture."""
        self.context.scene.photo = None
        self._release()

    # What is drawn

    def draw_tab(self) -> None:
        """Draw the tab."""
        draw_photo_tab(self)

    def draw_behind(self, draw: imgui.ImDrawList) -> None:
        """Draw the pins of the photo."""
        draw_photo_overlay(self.context, draw)

    # What the user does

    def ask(self) -> None:
        """Ask for a photo and open it."""
        folder = Path(self.photos[-1].path).parent if self.photos else last_folder(self.context.settings)
        start = folder if folder.is_dir() else last_folder(self.context.settings)
        self.context.ask_for_file(FileRequest("open", "Open a photo", "Photos", PHOTO_SUFFIXES, start, self.open))

    def accept_files(self, paths: tuple[str, ...]) -> bool:
        """Open what was dropped if all of it is pictures."""
        suffixes = (*PHOTO_SUFFIXES, *FOREIGN_SUFFIXES)
        if (
            self.context.is_modal
            or self.context.busy
            or not all(Path(path).suffix.lower() in suffixes for path in paths)
        ):
            return False
        for path in paths:
            self.open(Path(path))
        return True

    def open(self, path: Path) -> None:
        """Add the photo ``path`` to the session as one step, look through it and lead to the first pin."""
        context = self.context
        path = path.expanduser().absolute()
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
        self.pin()

    def choose(self, index: int) -> None:
        """Make photo ``index`` the one that the tab is about, and look through it."""
        if self.context.toolbox.active:
            return
        self.tool.active, self.tool.selected = index, None
        self._look(self.photos[index])
        if self.context.toolbox.chosen is self.tool:
            self.tool.place = self.tool.next_place(self.context.viewport)

    def look(self) -> None:
        """Look through the photo again."""
        if self.photo is not None:
            self._look(self.photo)

    def _look(self, photo: Photo, afresh: bool = False) -> None:
        """Show all of ``photo`` through its camera, or keep the zoom where the view looks through it already."""
        viewport, session = self.context.viewport, self.context.session
        if not afresh and isinstance(viewport.view, PictureView) and viewport.view.photo == photo.camera:
            viewport.view = viewport.view.back()
            return
        x, y, z = session.model.character.vertices.mean(axis=0).tolist()
        before = viewport.view
        ours = isinstance(before, PictureView) and any(before.photo.size == known.size for known in self.photos)
        locked = before.locked if ours and not afresh and isinstance(before, PictureView) else True
        view = PictureView.whole(photo.camera or first_camera(photo, session.model), (x, y, z))
        viewport.view = replace(view, locked=locked)
        self.context.redraw()

    def pin(self) -> None:
        """Take up the tool that sets pins, at the first place that has none."""
        self.look()
        self.context.toolbox.choose(self.tool.name)
        self.tool.place = self.tool.next_place(self.context.viewport)

    def skip(self) -> None:
        """Go on to the next place."""
        self.tool.skip(self.context.viewport)

    def place(self, place: Place) -> None:
        """Let the next press on the photo pin ``place``."""
        self.look()
        self.context.toolbox.choose(self.tool.name)
        self.tool.place = place

    def toggle(self) -> None:
        """Show the photo, or only the face."""
        if self.photo is not None:
            self.change(replace(self.photo, visible=not self.photo.visible), "Show or hide the photo")

    def change(self, photo: Photo, label: str, merges: bool = False) -> None:
        """Exchange the photo for ``photo`` as one step, or within the edit of a slider."""
        session, index = self.context.session, self.active
        assert index is not None
        document = with_photo(session.document, index, photo)
        if session.editing:
            session.replace(document)
            return
        with session.edit(label, merges):
            session.replace(document)

    def realign(self, focal: float | None) -> None:
        """Seek the camera anew with the focal length ``focal`` in pixels, or with the likely one if None."""
        photo, session = self.photo, self.context.session
        if photo is not None:
            changed = aligned(replace(photo, focal=focal), session.model, session.coefficients)
            self.change(changed, "Align the photo")

    def remove(self, index: int) -> None:
        """Take photo ``index`` out of the session as one step; its file stays."""
        session = self.context.session
        document = session.document
        with session.edit("Remove a photo"):
            session.replace(replace(document, photos=(*document.photos[:index], *document.photos[index + 1 :])))
        if self.photos:
            self.choose(min(self.active or 0, len(self.photos) - 1))

    def pose(self) -> None:
        """Let the face take the expression that the pins tell, as one step; what they told before goes."""
        photo, session = self.photo, self.context.session
        if photo is None or not self.enough:
            return
        self.context.toolbox.finish()
        with session.edit("Pose from the photo"):
            session.replace(with_expression(session.document, session.model, photo))
