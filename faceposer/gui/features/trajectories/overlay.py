"""Draws trajectories over the face: the points that can be taken, and the way of each with a dot at every frame."""

from typing import TYPE_CHECKING, Any

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from faceposer.gui.overlays.pins import draw_label
from faceposer.gui.viewport import Pixel
from faceposer.gui.widgets.theme import ACCENT, EDGE, INK, TARGET, Colour, u32

if TYPE_CHECKING:
    from faceposer.gui.app import App
    from faceposer.gui.features.trajectories.feature import Following

Array = NDArray[np.float64]
# Pixels at normal density between two dots below which not all are drawn.
_APART = 4.0


class TrajectoryPainter:
    """Draws into the view of an application."""

    def __init__(self, app: "App") -> None:
        """Draw for ``app``."""
        self._app = app
        self._candidates: tuple[object, dict[str, Pixel]] = (None, {})

    def paint(self, draw: imgui.ImDrawList, following: "Following") -> None:
        """Draw what the tool of ``following`` has, and the points that it could take."""
        app, tool = self._app, following.tool
        scale, origin = app.viewport.ui_scale, np.asarray(app.viewport.origin)
        playing = app.features.busy
        elapsed = app.session.document.frame - following.first
        # Elsewhere a press goes back to the first frame, where the face looks different.
        if not tool.drawing and not playing and elapsed == 0 and tool.fits(app.viewport):
            self._draw_candidates(draw, origin, scale)
        for drawn in tool.drawn:
            seen = drawn.seen_in(app.viewport.camera)
            if seen is None:
                continue
            _line(draw, seen + origin, scale, TARGET)
            frames = following.positions(drawn) * (app.viewport.camera.focal / drawn.camera.focal)
            frames = frames + (seen[0] - drawn.pixels[0] * (app.viewport.camera.focal / drawn.camera.focal)) + origin
            apart = float(np.hypot(*np.diff(frames, axis=0).T).mean())
            every = max(round(_APART * scale / max(apart, 1e-3)), 1)
            for x, y in frames[::every].tolist():
                draw.add_circle_filled((x, y), 1.6 * scale, u32(EDGE, 0.9))
            x, y = frames[min(max(elapsed, 0), len(frames) - 1)].tolist()
            _knob(draw, (x, y), 5.0 * scale, scale, TARGET)
        if tool.drawing:
            _line(draw, np.array(tool.drawing) + origin, scale, TARGET)
            u, v = tool.drawing[-1]
            _knob(draw, (u + float(origin[0]), v + float(origin[1])), 5.0 * scale, scale, TARGET)

    def _draw_candidates(self, draw: imgui.ImDrawList, origin: Array, scale: float) -> None:
        app = self._app
        key = (app.session.revision, app.viewport.view, app.viewport.size, app.toolbox)
        if key != self._candidates[0]:
            self._candidates = (key, app.toolbox.trajectory_tool.candidates(app.viewport))
        hover = app.toolbox.hover
        reach, nearest = 12.0 * scale, ""
        for name, pixel in self._candidates[1].items():
            x, y = pixel[0] + float(origin[0]), pixel[1] + float(origin[1])
            draw.add_circle_filled((x, y), 3.0 * scale, u32(EDGE, 0.7))
            draw.add_circle_filled((x, y), 2.0 * scale, u32(INK, 0.9))
            if hover is not None:
                distance = float(np.hypot(pixel[0] - hover.position[0], pixel[1] - hover.position[1]))
                if distance < reach:
                    reach, nearest = distance, name
        if nearest and not app.toolbox.active:
            at = self._candidates[1][nearest]
            _knob(draw, (at[0] + float(origin[0]), at[1] + float(origin[1])), 5.0 * scale, scale, ACCENT)
            vertex = app.session.model.subject.feature_points[nearest]
            draw_label(draw, app.viewport, at, app.drawn_constraints.names.name(int(vertex)))


def _line(draw: imgui.ImDrawList, pixels: Array, scale: float, colour: Colour) -> None:
    if len(pixels) < 2:
        return
    points: list[Any] = [ImVec2(x, y) for x, y in pixels.tolist()]
    draw.add_polyline(points, u32(EDGE, 0.6), 4.0 * scale, 0)
    draw.add_polyline(points, u32(colour), 2.2 * scale, 0)


def _knob(draw: imgui.ImDrawList, at: Pixel, radius: float, scale: float, colour: Colour) -> None:
    draw.add_circle_filled(at, radius + 1.5 * scale, u32(EDGE, 0.85))
    draw.add_circle_filled(at, radius, u32(colour))
