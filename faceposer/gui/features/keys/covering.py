"""Coverage of the animation by the keys: how far each frame is from them, and which frame would help most."""

from dataclasses import dataclass

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from faceposer.gui.context import EditorContext
from faceposer.gui.features.timeline.feature import TimelineFeature
from faceposer.gui.widgets.basic import disabled
from faceposer.gui.widgets.text import shortened
from faceposer.gui.widgets.theme import ACCENT, FAINT, FIELD, INK, KEYED, WARNING, em, u32
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.progress import Progress
from faceposer.session.jobs import ThreadJob
from faceposer.session.key_set import KeySet
from faceposer.transfer.key_coverage import OUTSIDE, coverage, helpful_frames

# Largest number of weights, frames times keys times regions, that are computed while the window waits, in some 10 ms.
_AT_ONCE = 100_000
# Widths in units of the font size: of the button, of the text, and of the graph below which the text is left out.
_BUTTON, _TEXT, _LEAST = 11.5, 15.0, 12.0


@dataclass(frozen=True, eq=False)
class Covered:
    """Coverage of an animation.

    Attributes:
        distances: Distance of each frame from the keys, (F,), in the unit of the source.
        missed: Share of the motion that the keys miss.
        limit: Distance above which a frame is outside the keys.
        best: Frame that would help most as a key, or None if no frame would.
        left: Share of the motion that is missed with this frame as a key.
    """

    distances: NDArray[np.float64]
    missed: float
    limit: float
    best: int | None
    left: float


def _covered(keys: KeySet, model: FaceModel, performance: Performance, progress: Progress) -> Covered:
    """Return the coverage of a ``performance`` of ``model``."""
    assert keys.transfer is not None
    poses = keys.source_poses(model, performance.coefficients)
    found = coverage(keys.transfer, poses, progress)
    helpful = helpful_frames(keys.transfer, poses, 1, progress=progress)
    best, left = (helpful[0].frame, helpful[0].missed) if helpful else (None, 0.0)
    limit = OUTSIDE * keys.source_model().character.height
    return Covered(found.distances, found.missed, limit, best, left)


class Covering:
    """Row of the strip with the coverage of the animation."""

    def __init__(self, context: EditorContext) -> None:
        """Cover the animation of ``context``."""
        self._context = context
        self._covered: tuple[KeySet, Performance, Covered | None] | None = None
        self._job: ThreadJob[Covered] | None = None
        self._input: tuple[KeySet, Performance] | None = None
        # Cancelled jobs, which end soon.
        self._ending: list[ThreadJob[Covered]] = []

    def of_animation(self, keys: KeySet) -> Covered | None:
        """Return the coverage of the animation by ``keys``; None without animation, or if it is of another face."""
        session = self._context.session
        if keys.transfer is None or not keys.is_of("source", session.model):
            return None
        last = self._covered
        if last is not None and last[0] is keys and self._context.busy:
            return last[2]
        performance = session.animation.performance
        if performance is None or len(performance) < 2:
            return None
        if last is not None and last[0] is keys and last[1] is performance:
            return last[2]
        model = session.model
        if len(performance) * len(keys.keys) * len(keys.transfer.regions) <= _AT_ONCE:
            self._cancel()
            self._covered = (keys, performance, _covered(keys, model, performance, Progress()))
            return self._covered[2]
        if self._input is None or self._input[0] is not keys or self._input[1] is not performance:
            self._cancel()
            self._input = (keys, performance)
            self._job = ThreadJob(lambda progress: _covered(keys, model, performance, progress), self._context.wake)
        # Until then, that of the animation before the last edit.
        return None if last is None else last[2]

    @property
    def busy(self) -> bool:
        """True while the coverage of a long animation is computed."""
        return self._job is not None

    def update(self) -> None:
        """Take the result of the background work.

        Raises:
            Exception: Its error, except a lack of memory, in which case no coverage is shown.
        """
        self._ending = [job for job in self._ending if not job.done]
        job, given = self._job, self._input
        if job is None or given is None or not job.done:
            return
        self._job = self._input = None
        self._context.redraw()
        if job.error is not None and not isinstance(job.error, MemoryError):
            raise job.error
        self._covered = (*given, job.result)

    def forget(self) -> None:
        """Forget the coverage."""
        self._cancel()
        self._covered = None

    def _cancel(self) -> None:
        if self._job is not None:
            self._job.cancel()
            self._ending.append(self._job)
        self._job = self._input = None

    def join(self) -> None:
        """Wait for the end of the background work."""
        for job in (*self._ending, *(() if self._job is None else (self._job,))):
            job.join()

    def go_to_best(self, keys: KeySet) -> None:
        """Show the frame that would help most as a key."""
        covered = self.of_animation(keys)
        if covered is not None and covered.best is not None:
            self._context.feature(TimelineFeature).go_to(covered.best)

    def draw(self, covered: Covered, keys: KeySet) -> None:
        """Draw the row: text, graph and button."""
        room = imgui.get_content_region_avail().x
        gap = imgui.get_style().item_spacing.x
        graph = room - em(_BUTTON) - gap
        if graph - em(_TEXT) - gap > em(_LEAST):
            graph -= em(_TEXT) + gap
            most = 10.0 * float(covered.distances.max())
            imgui.align_text_to_frame_padding()
            left = imgui.get_cursor_pos_x()
            text = f"{100.0 * covered.missed:.1f} % missed, up to {most:.1f} mm"
            imgui.text_unformatted(shortened(text, em(_TEXT)))
            tooltip("Share of the motion that no combination of keys has, and the largest distance of a frame from it")
            imgui.same_line(left + em(_TEXT) + gap)
        self._draw_graph(covered, max(graph, em(2.0)))
        imgui.same_line()
        label = "All frames covered" if covered.best is None else f"Go to frame {covered.best + 1}"
        with disabled(covered.best is None):
            if imgui.button(f"{label}##keys-best", (em(_BUTTON), 0.0)):
                self.go_to_best(keys)
        self._context.widget_rects.record("keys:best")
        if covered.best is not None:
            tooltip(
                f"Frame {covered.best + 1} would help most as a key: with it, {100.0 * covered.left:.1f} % is missed"
            )

    def _draw_graph(self, covered: Covered, width: float) -> None:
        context, height = self._context, imgui.get_frame_height()
        low = imgui.get_cursor_screen_pos()
        imgui.invisible_button("##keys-coverage", ImVec2(width, height))
        context.widget_rects.record("keys:coverage")
        count = len(covered.distances)
        if imgui.is_item_active():
            share = (imgui.get_mouse_pos().x - low.x) / width
            context.feature(TimelineFeature).go_to(min(max(int(share * count), 0), count - 1))
        draw = imgui.get_window_draw_list()
        draw.add_rect_filled(low, ImVec2(low.x + width, low.y + height), u32(FIELD), em(0.15))
        top = max(float(covered.distances.max()), 1.5 * covered.limit)
        columns = max(min(int(width / 2.0), count), 1)
        edges = np.linspace(0, count, columns + 1).astype(np.intp)
        highest = np.maximum.reduceat(covered.distances, edges[:-1])
        step = width / columns
        for i, value in enumerate(highest.tolist()):
            colour = WARNING if value > covered.limit else FAINT
            tall = max(value / top * (height - 2.0), 1.0)
            left = low.x + i * step
            right = left + max(step - 0.5, 1.0)
            draw.add_rect_filled((left, low.y + height - tall), (right, low.y + height), u32(colour, 0.85))
        limit = low.y + height - covered.limit / top * (height - 2.0)
        draw.add_line((low.x, limit), (low.x + width, limit), u32(INK, 0.25))
        for frame, colour in ((covered.best, KEYED), (context.session.animation.frame, ACCENT)):
            if frame is not None and frame < count:
                x = low.x + (frame + 0.5) / count * width
                draw.add_line((x, low.y), (x, low.y + height), u32(colour), max(em(0.12), 1.0))
        tooltip(
            "Distance of each frame from the keys; orange frames are outside, the yellow one would help most as a key. "
            "Click to go to a frame"
        )
