"""The handle in front of the face that both eyes follow."""

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


def eyes_of(character: Character) -> NDArray[np.float64] | None:
    """Return the centres of both eyes of the neutral face, shape (2, 3), or None where it has none to turn."""
    if not any(name.startswith("eyeLook") for name in character.shape_names):
        return None
    parts = [part for part in character.parts if part.material == "eye"]
    if len(parts) != 2:
        return None
    centres = [character.vertices[slice(*part.vertices)].mean(axis=0) for part in parts]
    return np.array(centres, dtype=np.float64)


def pupils_of(character: Character, direction: tuple[float, float]) -> NDArray[np.float64] | None:
    """Return the middles of the pupils of eyes turned to ``direction`` in degrees, (2, 3), or None without eyes.

    They lie where a ray from the centre of each eye leaves it.
    """
    centres = eyes_of(character)
    if centres is None:
        return None
    forward = _forward(direction)
    parts = [part for part in character.parts if part.material == "eye"]
    # The eye is turned, not the ray: an eyeball reaches as far forward whichever way it looks.
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
    """Return where in space the handle is for a ``direction`` in degrees, shape (3,), or None without eyes."""
    eyes = eyes_of(character)
    if eyes is None:
        return None
    position: NDArray[np.float64] = eyes.mean(axis=0) + REACH_CM * _forward(direction)
    return position


def direction_under(
    character: Character, camera: Camera, pixel: Pixel, near: NDArray[np.float64]
) -> tuple[float, float]:
    """Return the direction, in degrees, whose handle lies under ``pixel``, of two the one nearer to ``near``, (3,).

    The ray of the pixel is met with the sphere that the handle moves on, or comes as near to it as it can.
    """
    eyes = eyes_of(character)
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
    """Lets both eyes follow a handle."""

    name = "gaze"
    cursor = "press"
    drag_cursor = "grab"
    handle_order = 0

    def constraint(self, context: ToolContext) -> tuple[int, GazeConstraint] | None:
        """Return the gaze constraint of the session with its index, or None."""
        for i, constraint in enumerate(context.session.document.constraints):
            if isinstance(constraint, GazeConstraint):
                return i, constraint
        return None

    def direction(self, context: ToolContext) -> tuple[float, float]:
        """Return where the handle is now, in degrees."""
        found = self.constraint(context)
        if found is not None:
            return found[1].direction
        return gaze_direction(context.session.model, context.session.coefficients)

    def handle(self, context: ToolContext) -> Pixel | None:
        """Return where the view shows the handle, or None where the face has no eyes to turn."""
        position = handle_position(context.session.model.character, self.direction(context))
        if position is None:
            return None
        u, v = context.camera.project(position[None])[0].tolist()
        return (u, v)

    def _reached(self, position: Pixel, context: ToolContext) -> bool:
        """Whether ``position`` is on the handle, and the face does not hide it there."""
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
        """Whether the press ``event`` takes hold of the handle of a gaze constraint."""
        found = self.constraint(context)
        left = event.button == "left" and not event.modifiers
        return left and found is not None and not found[1].locked and self._reached(event.position, context)

    @property
    def works_beside(self) -> bool:
        """Whether a press beside the face does something, too: the handle follows a drag anywhere in the view."""
        return True

    def begins(self, event: PointerEvent, context: ToolContext) -> bool:
        """Whether the press ``event`` begins to turn the eyes, which it does anywhere in the view."""
        has_eyes = eyes_of(context.session.model.character) is not None
        return event.button == "left" and not event.modifiers and has_eyes

    def handle_under(self, position: Pixel, context: ToolContext) -> int | None:
        """Return the gaze constraint if a press at ``position`` would take its handle, or None."""
        found = self.constraint(context)
        press = PointerEvent("press", position, "left")
        return found[0] if found is not None and self.hits_handle(press, context) else None

    def gesture(self, event: PointerEvent, context: ToolContext) -> Gesture:
        """Drag the handle while the eyes follow; it moves as the pointer does, wherever that is."""
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
                direction = direction_under(character, context.camera, (u, v), near)
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
        """Release the eyes if ``position`` is on the handle; return whether it was."""
        found = self.constraint(context)
        if found is None or found[1].locked or not self._reached(position, context):
            return False
        self._remove(found[0], "Release the eyes", context)
        return True

    def hint(self, context: ToolContext) -> str:
        """Return what a press will do."""
        if eyes_of(context.session.model.character) is None:
            return "This face has no eyes that turn"
        return "Drag anywhere: both eyes follow the ring   ·   right click on the ring: release them"
