"""The gaze target in front of the face, which both eyes follow."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.model.character import Character
from faceposer.solve.constraints.gaze import REACH_CM, GazeConstraint, gaze_direction
from faceposer.tools.tool import Gesture, PointerEvent, PosingTool, ToolContext

_REACH = 13.0
Pixel = tuple[float, float]


def eye_centres_of(character: Character) -> NDArray[np.float64] | None:
    """Return the centres of both eyes of the neutral face, shape (2, 3), or None if it has no movable eyes."""
    if not any(name.startswith("eyeLook") for name in character.shape_names):
        return None
    parts = [part for part in character.parts if part.material == "eye"]
    if len(parts) != 2:
        return None
    centres = [character.vertices[slice(*part.vertices)].mean(axis=0) for part in parts]
    return np.array(centres, dtype=np.float64)


def pupil_centres_of(character: Character, direction: tuple[float, float]) -> NDArray[np.float64] | None:
    """Return the pupil centres of eyes turned to ``direction`` in degrees, (2, 3), or None without eyes.

    They are the points where a ray from the centre of each eye leaves it.
    """
    centres = eye_centres_of(character)
    if centres is None:
        return None
    forward = _forward(direction)
    parts = [part for part in character.parts if part.material == "eye"]
    # The eyeball turns with the ray, so that its extent along the ray is that along z in the neutral face.
    depths = [
        float((character.vertices[slice(*part.vertices)][:, 2] - centre[2]).max())
        for part, centre in zip(parts, centres, strict=True)
    ]
    pupils: NDArray[np.float64] = centres + np.array(depths)[:, None] * forward
    return pupils


def _forward(direction: tuple[float, float]) -> NDArray[np.float64]:
    """Return ``direction``, degrees to the character's left and upwards, as a unit vector, shape (3,)."""
    yaw, pitch = (math.radians(angle) for angle in direction)
    return np.array((math.sin(yaw) * math.cos(pitch), math.sin(pitch), math.cos(yaw) * math.cos(pitch)))


def handle_position(character: Character, direction: tuple[float, float]) -> NDArray[np.float64] | None:
    """Return the position of the handle for a ``direction`` in degrees, shape (3,), or None without eyes."""
    eyes = eye_centres_of(character)
    if eyes is None:
        return None
    position: NDArray[np.float64] = eyes.mean(axis=0) + REACH_CM * _forward(direction)
    return position


def direction_at_pixel(
    character: Character, camera: Camera, pixel: Pixel, near: NDArray[np.float64]
) -> tuple[float, float]:
    """Return the direction, in degrees, with its handle under ``pixel``; of two, the one closer to ``near``, (3,).

    It intersects the ray of the pixel with the sphere of handle positions, or takes the point closest to the sphere.
    """
    eyes = eye_centres_of(character)
    assert eyes is not None
    centre = eyes.mean(axis=0)
    origin, ray = camera.ray(pixel)
    along = float((centre - origin) @ ray)
    closest = origin + along * ray
    missed = float(np.linalg.norm(closest - centre))
    half = math.sqrt(max(REACH_CM**2 - missed**2, 0.0))
    candidates = [closest - half * ray, closest + half * ray]
    best = min(candidates, key=lambda place: float(np.linalg.norm(place - near)))
    x, y, z = (best - centre) / max(float(np.linalg.norm(best - centre)), 1e-9)
    return (math.degrees(math.atan2(x, z)), math.degrees(math.asin(min(max(y, -1.0), 1.0))))


class GazeTool(PosingTool):
    """Turns both eyes to a handle."""

    name = "gaze"
    label = "Gaze"
    key = "G"
    help = "Drag anywhere in the view to turn both eyes"
    empty_text = "Drag in the view to turn both eyes to the ring."
    cursor = "press"
    drag_cursor = "grab"
    handle_order = 0

    def usable(self, character: Character) -> bool:
        """Return True if the eyes of ``character`` can turn."""
        return eye_centres_of(character) is not None

    def constraint(self, context: ToolContext) -> tuple[int, GazeConstraint] | None:
        """Return the gaze constraint of the session with its index, or None."""
        for i, constraint in enumerate(context.session.document.constraints):
            if isinstance(constraint, GazeConstraint):
                return i, constraint
        return None

    def direction(self, context: ToolContext) -> tuple[float, float]:
        """Return the direction of the handle, in degrees."""
        found = self.constraint(context)
        if found is not None:
            return found[1].direction
        return gaze_direction(context.session.model, context.session.coefficients)

    def handle(self, context: ToolContext) -> Pixel | None:
        """Return the pixel of the handle in the view, or None if the face has no movable eyes."""
        position = handle_position(context.session.model.character, self.direction(context))
        if position is None:
            return None
        u, v = context.camera.project(position[None])[0].tolist()
        return (u, v)

    def _hits_visible_handle(self, position: Pixel, context: ToolContext) -> bool:
        """Return True if ``position`` is on the handle and the face does not hide it there."""
        handle = self.handle(context)
        if handle is None or math.dist(position, handle) > _REACH * context.ui_scale:
            return False
        session, camera = context.session, context.camera
        found, met = context.pick_many([handle])
        place = handle_position(session.model.character, self.direction(context))
        if place is None or not met[0]:
            return True
        surface = session.model.positions_at(found, session.coefficients)
        return bool(camera.to_camera(place[None])[0, 2] < camera.to_camera(surface)[0, 2])

    def hits_handle(self, event: PointerEvent, context: ToolContext) -> bool:
        """Return True if the press ``event`` hits the handle of a gaze constraint."""
        found = self.constraint(context)
        left = event.button == "left" and not event.modifiers
        return left and found is not None and not found[1].locked and self._hits_visible_handle(event.position, context)

    @property
    def works_off_face(self) -> bool:
        """True: the handle follows a drag that starts anywhere in the view."""
        return True

    def begins(self, event: PointerEvent, context: ToolContext) -> bool:
        """Return True if the press ``event`` starts to turn the eyes, which is possible anywhere in the view."""
        has_eyes = eye_centres_of(context.session.model.character) is not None
        return event.button == "left" and not event.modifiers and has_eyes

    def handle_under(self, position: Pixel, context: ToolContext) -> int | None:
        """Return the gaze constraint if a press at ``position`` would grab its handle, or None."""
        found = self.constraint(context)
        press = PointerEvent("press", position, "left")
        return found[0] if found is not None and self.hits_handle(press, context) else None

    def gesture(self, event: PointerEvent, context: ToolContext) -> Gesture:
        """Drag the handle by the motion of the pointer, which need not start on it."""
        # on press
        session = context.session
        character = session.model.character
        handle, found = self.handle(context), self.constraint(context)
        if handle is None or (found is not None and found[1].locked):
            return
        grip = np.subtract(handle, event.position)
        begun = GazeConstraint(self.direction(context)) if found is None else found[1]
        index = len(session.document.constraints) if found is None else found[0]
        moved = False
        with session.edit("Turn the eyes"):
            while True:
                event = yield
                # on release
                if event.kind == "release":
                    break
                # on move
                moved = True
                near = handle_position(character, begun.direction)
                assert near is not None
                u, v = (np.asarray(event.position) + grip).tolist()
                direction = direction_at_pixel(character, context.camera, (u, v), near)
                begun = replace(begun, direction=direction).within_reach()
                document = session.document
                if index < len(document.constraints):
                    session.replace(document.with_constraint(index, begun))
                else:
                    session.replace(replace(document, constraints=(*document.constraints, begun)))
            if not moved:
                session.restore()
            else:
                self._settings.selection.set(index)

    def remove_at(self, position: Pixel, context: ToolContext) -> bool:
        """Release the eyes if ``position`` is on the handle; return True if it is."""
        found = self.constraint(context)
        if found is None or found[1].locked or not self._hits_visible_handle(position, context):
            return False
        self._remove(found[0], "Release the eyes", context)
        return True

    def hint(self, context: ToolContext) -> str:
        """Return the effect of a press, for the status bar."""
        if eye_centres_of(context.session.model.character) is None:
            return "This character has no movable eyes"
        return "Drag anywhere: turn both eyes   ·   right click the ring: release them"
