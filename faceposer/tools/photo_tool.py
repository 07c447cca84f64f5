"""Pins of a photo: image positions of places of the face, which determine the photo's camera."""

import math

from faceposer.geometry.picture_view import PictureView
from faceposer.photo.aligning import aligned
from faceposer.photo.photo import Photo, Pin, Place
from faceposer.photo.places import guided
from faceposer.session.photos import with_photo
from faceposer.tools.point_tool import CLICK_THRESHOLD
from faceposer.tools.tool import Gesture, PointerEvent, PosingTool, ToolContext, ToolSettings

Pixel = tuple[float, float]
# In pixels of a display at normal density.
_REACH = 11.0
# While pins are set one after another: the next place may be close to the last.
_REACH_BETWEEN = 6.0


class PhotoTool(PosingTool):
    """Sets pins on the photo in the view, one place of the face after another, and drags them.

    Attributes:
        active: Index of the photo in the document, or None.
        place: Place to be pinned by the next press on the photo, or None to only drag pins.
        selected: Index of the last pin that was set or dragged, or None.
    """

    name = "photo"
    label = "Photo"
    key = ""
    help = "Set pins on the photo"
    empty_text = "Set pins on the photo; the Photo tab lists them. Posing from the photo turns them into constraints."
    cursor = "press"
    drag_hint = "Move: shift the pin and update the camera   ·   release: confirm   ·   Esc: cancel"

    def __init__(self, tool_settings: ToolSettings) -> None:
        """Use the shared ``tool_settings``; no photo is active."""
        super().__init__(tool_settings)
        self.active: int | None = None
        self.place: Place | None = None
        self.selected: int | None = None

    def photo(self, context: ToolContext) -> Photo | None:
        """Return the photo whose camera is that of the view, or None."""
        photos = context.session.document.photos
        if self.active is None or self.active >= len(photos) or not isinstance(context.view, PictureView):
            return None
        return photos[self.active] if context.view.aligned else None

    def pixels(self, context: ToolContext) -> list[Pixel]:
        """Return the pixel of each pin of the photo in the view."""
        photo, camera = self.photo(context), context.camera
        if photo is None or photo.camera is None:
            return []
        scale = camera.focal / photo.camera.focal
        (u, v), (x, y) = photo.camera.principal_point.tolist(), camera.principal_point.tolist()
        return [((pin.pixel[0] - u) * scale + x, (pin.pixel[1] - v) * scale + y) for pin in photo.pins]

    def pin_at(self, position: Pixel, context: ToolContext) -> int | None:
        """Return the pin within reach of ``position``, the nearest one, or None."""
        pixels = self.pixels(context)
        distances = [math.hypot(u - position[0], v - position[1]) for u, v in pixels]
        nearest = min(range(len(pixels)), key=distances.__getitem__, default=None)
        reach = (_REACH if self.place is None else _REACH_BETWEEN) * context.ui_scale
        return nearest if nearest is not None and distances[nearest] <= reach else None

    def next_place(self, context: ToolContext, after: Place | None = None) -> Place | None:
        """Return the first place without a pin in the guided order, starting after ``after``, or None."""
        photo = self.photo(context)
        order = guided(context.session.model.character)
        begin = order.index(after) + 1 if isinstance(after, str) and after in order else 0
        pinned = {pin.place for pin in photo.pins} if photo is not None else set()
        return next((place for place in order[begin:] if place not in pinned), None)

    def begins(self, event: PointerEvent, context: ToolContext) -> bool:
        """Return True if the press ``event`` grabs or sets a pin, or with Shift picks a place of the face."""
        if event.button != "left" or event.modifiers - {"shift"} or self.photo(context) is None:
            return False
        return self.place is not None or bool(event.modifiers) or self.pin_at(event.position, context) is not None

    @property
    def works_off_face(self) -> bool:
        """True if a press sets the next pin, on the face or not."""
        return self.place is not None

    def gesture(self, event: PointerEvent, context: ToolContext) -> Gesture:
        """Drag a pin; a press away from all pins sets a new one."""
        # on press
        photo = self.photo(context)
        assert photo is not None
        if event.modifiers:
            self.place = context.pick(event.position) or self.place
            return
        index = self.pin_at(event.position, context)
        begin, view = event.position, context.view
        while index is not None and self.place is not None:
            event = yield
            # on release: places may be close together, such as closed lips; only a drag grabs the existing pin
            if event.kind == "release":
                index = None
            elif math.dist(event.position, begin) > CLICK_THRESHOLD * context.ui_scale:
                break
        place = self.place if index is None else photo.pins[index].place
        assert place is not None
        handle = begin if index is None else self.pixels(context)[index]
        try:
            with context.session.edit("Set a pin" if index is None else "Move a pin"):
                self.selected = len(photo.pins) if index is None else index
                while True:
                    # on move
                    x, y = (handle[i] + event.position[i] - begin[i] for i in range(2))
                    if index is None or event.position != begin:
                        self._set(Pin(place, self._in_photo((x, y), photo, view, context)), context)
                    # on release
                    if event.kind == "release":
                        break
                    event = yield
        except GeneratorExit:
            context.view = view
            raise
        if index is None:
            self.place = self.next_place(context, place)

    def _in_photo(self, position: Pixel, photo: Photo, view: object, context: ToolContext) -> Pixel:
        """Return the photo's pixel at ``position`` of the view, clipped to the photo."""
        assert isinstance(view, PictureView)
        scale = view.scale(context.size)
        u, v = (view.middle[i] + (position[i] - context.size[i] / 2.0) / scale for i in range(2))
        return (min(max(u, 0.0), float(photo.size[0])), min(max(v, 0.0), float(photo.size[1])))

    def _set(self, pin: Pin, context: ToolContext) -> None:
        photo = self.photo(context)
        if photo is not None:
            self.change(photo.with_pin(pin), context)

    def change(self, photo: Photo, context: ToolContext) -> None:
        """Replace the photo inside an open edit, and update its camera and the view from its pins."""
        session = context.session
        assert self.active is not None
        document = with_photo(session.document, self.active, aligned(photo, session.model, session.coefficients))
        session.replace(document)
        camera = document.photos[self.active].camera
        if camera is not None and isinstance(context.view, PictureView):
            context.view = context.view.through(camera)

    def remove(self, index: int, context: ToolContext) -> None:
        """Remove pin ``index`` of the photo as one step."""
        photo = self.photo(context)
        if photo is None or index >= len(photo.pins):
            return
        self.selected = None
        with context.session.edit("Remove a pin"):
            self.change(photo.without_pin(index), context)
        self.place = self.place or self.next_place(context)

    def remove_at(self, position: Pixel, context: ToolContext) -> bool:
        """Remove the pin at ``position``."""
        index = self.pin_at(position, context)
        if index is not None:
            self.remove(index, context)
        return index is not None

    def skip(self, context: ToolContext) -> None:
        """Go to the next place; after the last one, to the first without a pin."""
        self.place = self.next_place(context, self.place) or self.next_place(context)

    def discard(self) -> bool:
        """Stop setting pins until a place is chosen; return True if a place was active."""
        had, self.place = self.place is not None, None
        return had

    def hint(self, context: ToolContext) -> str:
        """Return the effect of a press, for the status bar."""
        if self.photo(context) is None:
            return "Look through a photo to set pins on it"
        if self.place is None:
            return "Drag a pin: move it   ·   right click: remove it   ·   wheel: zoom"
        return "Press where the photo shows the place   ·   Tab: skip   ·   wheel: zoom   ·   Shift+middle drag: pan"
