"""Overlay of trajectories: the points that the tool snaps to, and each path with a dot at every frame."""

from typing import Any

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from faceposer.gui.context import EditorContext
from faceposer.gui.features.trajectories.options import ShownTrajectories
from faceposer.gui.overlays.pins import draw_label
from faceposer.gui.viewport import Pixel
from faceposer.gui.widgets.theme import ACCENT, EDGE, INK, TARGET, Colour, u32

Array = NDArray[np.float64]
# Least distance of two dots in pixels at normal density.
_LEAST_SPACING = 4.0


class TrajectoryOverlay:
    """Overlay of the drawn trajectories."""

    def __init__(self, context: EditorContext) -> None:
        """Draw over the view of ``context``."""
        self._context = context
        self._candidates: tuple[object, dict[str, Pixel]] = (None, {})

    def draw(self, draw: imgui.ImDrawList, shown: ShownTrajectories) -> None:
        """Draw the trajectories ``shown``, and the points that its tool snaps to."""
        context, tool = self._context, shown.tool
        scale, origin = context.viewport.ui_scale, np.asarray(context.viewport.origin)
        playing = context.playing
        elapsed = context.session.document.frame - shown.first
        # At other frames a press goes to the first frame, where the points are elsewhere.
        if not tool.drawing and not playing and elapsed == 0 and tool.fits(context.viewport):
            self._draw_candidates(draw, origin, scale)
        for drawn in tool.drawn:
            pixels = drawn.seen_in(context.viewport.camera)
            if pixels is None:
                continue
            _draw_path(draw, pixels + origin, scale, TARGET)
            zoom = context.viewport.camera.focal / drawn.camera.focal
            frames = shown.positions(drawn) * zoom + (pixels[0] - drawn.pixels[0] * zoom) + origin
            spacing = float(np.hypot(*np.diff(frames, axis=0).T).mean())
            step = max(round(_LEAST_SPACING * scale / max(spacing, 1e-3)), 1)
            for x, y in frames[::step].tolist():
                draw.add_circle_filled((x, y), 1.6 * scale, u32(EDGE, 0.9))
            x, y = frames[min(max(elapsed, 0), len(frames) - 1)].tolist()
            _draw_knob(draw, (x, y), 5.0 * scale, scale, TARGET)
        if tool.drawing:
            _draw_path(draw, np.array(tool.drawing) + origin, scale, TARGET)
            u, v = tool.drawing[-1]
            _draw_knob(draw, (u + float(origin[0]), v + float(origin[1])), 5.0 * scale, scale, TARGET)

    def _draw_candidates(self, draw: imgui.ImDrawList, origin: Array, scale: float) -> None:
        context = self._context
        key = (context.session.revision, context.viewport.view, context.viewport.size, context.toolbox)
        if key != self._candidates[0]:
            self._candidates = (key, context.toolbox.trajectory_tool.candidates(context.viewport))
        hover = context.toolbox.hover
        reach, nearest = 12.0 * scale, ""
        for name, pixel in self._candidates[1].items():
            x, y = pixel[0] + float(origin[0]), pixel[1] + float(origin[1])
            draw.add_circle_filled((x, y), 3.0 * scale, u32(EDGE, 0.7))
            draw.add_circle_filled((x, y), 2.0 * scale, u32(INK, 0.9))
            if hover is not None:
                distance = float(np.hypot(pixel[0] - hover.position[0], pixel[1] - hover.position[1]))
                if distance < reach:
                    reach, nearest = distance, name
        if nearest and not context.toolbox.active:
            at = self._candidates[1][nearest]
            _draw_knob(draw, (at[0] + float(origin[0]), at[1] + float(origin[1])), 5.0 * scale, scale, ACCENT)
            vertex = context.session.model.character.feature_points[nearest]
            draw_label(draw, context.viewport, at, context.drawn_constraints.names.name(int(vertex)))


def _draw_path(draw: imgui.ImDrawList, pixels: Array, scale: float, colour: Colour) -> None:
    if len(pixels) < 2:
        return
    points: list[Any] = [ImVec2(x, y) for x, y in pixels.tolist()]
    draw.add_polyline(points, u32(EDGE, 0.6), 4.0 * scale, 0)
    draw.add_polyline(points, u32(colour), 2.2 * scale, 0)


def _draw_knob(draw: imgui.ImDrawList, at: Pixel, radius: float, scale: float, colour: Colour) -> None:
    draw.add_circle_filled(at, radius + 1.5 * scale, u32(EDGE, 0.85))
    draw.add_circle_filled(at, radius, u32(colour))
