"""Photos in the window: the tab, the photo in the view, dropped photos."""

import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from imgui_bundle import imgui

from faceposer.errors import FacePoserError
from faceposer.geometry.picture_view import PictureView
from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.photo.actions import photo_actions
from faceposer.gui.features.photo.commands import PhotoCommands
from faceposer.gui.features.photo.layers import Shown, photo_layer
from faceposer.gui.features.photo.offering import offer_photos
from faceposer.gui.features.photo.overlay import draw_busy, draw_photo_overlay
from faceposer.gui.features.photo.panel import draw_photo_tab
from faceposer.gui.viewport import Pixel
from faceposer.photo.aligning import first_camera
from faceposer.photo.photo import Photo, Place
from faceposer.photo.reading import inspect_photo
from faceposer.session.jobs import Job
from faceposer.solve.camera_fit import LEAST_POINTS

# Share of the view's height below which a head is small.
_SMALL = 0.5
_WIPE_HINT = (
    "Drag: move the line between photo and face   ·   Ctrl+Left Ctrl+Right: move it by keys   ·   Shift+W: no wipe"
)
# Seconds between two pictures of a bar of progress: more would take the time of the work.
_BAR_SECONDS = 0.1


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


class PhotoFeature(PhotoCommands, Feature):
    """The tab "Photo", and the photo in the view."""

    tab = ("Photo", "Pose the face from a photo, or make a character of the person in it")

    def __init__(self, context: EditorContext) -> None:
        """Serve ``context``; photos are read when they are first shown."""
        super().__init__(context)
        Feature.__init__(self, context)
        # Path of the photo and its number of pins in the last frame.
        self._last_pin_count = ("", 0)
        # Path of the photo and places of its pins in the last frame, and the revision of the session.
        self._last_pins: tuple[str, tuple[Place, ...], int] = ("", (), -1)
        # True if the photo has to be framed as soon as the view has a size.
        self._framing_pending = False
        self._bar_drawn = 0.0

    @property
    def traced(self) -> bool:
        """True with a photo: the tools then draw over it."""
        return bool(self.photos)

    @property
    def job(self) -> Job[object] | None:
        """The work in the background that the view tells of, or None."""
        return self.expression.job or self.putting_back.job

    @property
    def patience(self) -> float:
        """Seconds for which the loop may sleep."""
        return _BAR_SECONDS if self.job is not None else super().patience

    @property
    def hint(self) -> str:
        """Hint for the mouse on the line between photo and face."""
        return _WIPE_HINT if self.wipe.hovered else ""

    def contains(self, position: Pixel) -> bool:
        """Return True if ``position``, in window units, is on the line between photo and face."""
        return self.wipe.contains(position)

    def cancel(self) -> bool:
        """Cancel the search for an expression; return True if there was one."""
        return self.expression.cancel()

    def actions(self) -> Sequence[Action | Submenu]:
        """Return its menu entries."""
        return photo_actions(self)

    # The loop

    def session_changed(self) -> None:
        """Look through the photo that the session was saved with, and report missing files."""
        # Files may have changed on disk.
        self.context.scene.photo = None
        self.textures.release()
        self.putting_back.forget()
        self.expression.cancel()
        self.wipe.reset()
        if self.photos:
            self.context.dismiss_guide()
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
        self.putting_back.update()
        if self.job is not None and time.monotonic() - self._bar_drawn > _BAR_SECONDS:
            self._bar_drawn = time.monotonic()
            self.context.redraw(1)
        if self.tool.active is not None and self.active is None:
            self.tool.active = len(self.photos) - 1 if self.photos else None
            if not self.photos and isinstance(viewport.view, PictureView):
                viewport.view = viewport.framed()
                if self.context.toolbox.chosen is self.tool:
                    self.context.toolbox.choose("point")
        if self._framing_pending and self.photo is not None and viewport.size != (1, 1):
            self._framing_pending = False
            self.look_through_photo(self.photo, reset=True)
        self._adopt_view_camera()
        self._follow_undo()
        photo, view = self.photo, viewport.view
        if self.putting_back.on and (photo is None or not self.putting_back.possible(photo)):
            self.putting_back.switch(False)
        layer = None
        if photo is not None and isinstance(view, PictureView) and view.photo.size == photo.size:
            camera = photo.camera or first_camera(photo, self.context.session.model)
            if view.photo != camera:
                view = viewport.view = view.through(camera)
            self._suggest_framing(photo)
            texture = self.textures.texture(self.context.gl, photo.path) if photo.visible else None
            if texture is not None:
                split = self.wipe.share if self.wipe.on else None
                shown = Shown(texture, partial(self.putting_back.picture, photo), self.pinning, split)
                layer = photo_layer(photo, camera, view, shown)
        self.wipe.shown = layer is not None and layer.left is not None
        if layer != scene.photo:
            scene.photo = layer
            self.context.redraw()
        # Released here rather than when a texture is added, because this frame may still draw it.
        self.textures.trim(kept="" if photo is None else photo.path)

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
                self.look_through_photo(photo)

    def _suggest_framing(self, photo: Photo) -> None:
        """Suggest once to frame a head that is small in the photo, as soon as it is aligned."""
        context, before = self.context, self._last_pin_count
        self._last_pin_count = (photo.path, len(photo.pins))
        if context.toolbox.active:
            self._last_pin_count = before
        elif before[0] == photo.path and before[1] < LEAST_POINTS <= len(photo.pins):
            head = context.viewport.camera.project(context.scene.vertices)
            # A note on the face that was found comes first.
            if not context.notice and float(np.ptp(head[:, 1])) < _SMALL * context.viewport.size[1]:
                context.notify(f"Press {context.actions['frame'].shortcut} to zoom in on the head")

    def join(self) -> None:
        """Wait for the face that is being found."""
        self.expression.join()
        self.putting_back.join()

    def close(self) -> None:
        """Cancel the work and release the textures."""
        self.expression.cancel()
        self.context.scene.photo = None
        self.textures.release()
        self.putting_back.forget()

    def accept_files(self, dropped: tuple[str, ...]) -> bool:
        """Ask what becomes of dropped photos."""
        return offer_photos(self, dropped)

    # Drawing

    def draw_over(self, draw: imgui.ImDrawList) -> None:
        """Draw the line between photo and face, and what is being done in the background."""
        self.wipe.draw_line(draw)
        if self.job is not None:
            draw_busy(self.context, draw, self.job, "Esc: cancel" if self.job is self.expression.job else "")

    def draw_window(self) -> None:
        """Let the pointer take the line between photo and face."""
        self.wipe.draw_handle()

    def draw_tab(self) -> None:
        """Draw the tab."""
        draw_photo_tab(self)

    def draw_behind(self, draw: imgui.ImDrawList) -> None:
        """Draw the pins of the photo."""
        draw_photo_overlay(self.context, draw)
