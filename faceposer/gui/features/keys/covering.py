"""Coverage of the animation by the keys: how far each frame is from them, and which frame would help most."""

import math
from dataclasses import dataclass

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from faceposer.gui.context import EditorContext
from faceposer.gui.features.timeline.feature import TimelineFeature
from faceposer.gui.features.timeline.track import frames_span
from faceposer.gui.widgets.basic import fitted_button
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
# Distance from the keys, in centimetres, below which a frame is reached: it is shown as 0.0 mm.
_REACHED = 0.005
#: Height of the graph in units of the font size.
GRAPH = 1.5
# Least width in pixels of the bar of a frame.
_NARROWEST = 2.0


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
    reached = float(found.distances.max()) < _REACHED
    best, left = (helpful[0].frame, helpful[0].missed) if helpful and not reached else (None, 0.0)
    limit = OUTSIDE * keys.source_model().character.height
    return Covered(found.distances, found.missed, limit, best, left)


class Covering:
    """Graph and button of the coverage of the animation."""

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

    def button(self, covered: Covered, keys: KeySet, width: float) -> None:
        """Draw the button that goes to the frame that would help most, if there is one."""
        if covered.best is None:
            return
        share = f"{100.0 * covered.left:.1f} %"
        tip = (
            f"{self.text(covered)}\nFrame {covered.best + 1} would help most as a key pose: with it, {share} of the "
            "motion is missed"
        )
        if fitted_button(self._context.widget_rects, f"Go to frame {covered.best + 1}", "keys:best", width, tip):
            self.go_to_best(keys)

    def summary(self, covered: Covered) -> str:
        """Return how much the keys cover, in a few words."""
        return "all frames covered" if covered.best is None else f"{100.0 * covered.missed:.1f} % missed"

    def text(self, covered: Covered) -> str:
        """Return how much the keys miss, in one sentence."""
        most = 10.0 * float(covered.distances.max())
        share = f"{100.0 * covered.missed:.1f} %"
        return f"{share} of the motion is missed; frames are up to {most:.1f} mm from the key poses."

    def draw(self, covered: Covered) -> None:
        """Draw the graph over the width of the strip, with its frames below those of the timeline."""
        context, height = self._context, em(GRAPH)
        corner, width = imgui.get_cursor_screen_pos(), imgui.get_window_width()
        imgui.invisible_button("##keys-coverage", ImVec2(width, height))
        context.widget_rects.record("keys:coverage")
        timeline = context.feature(TimelineFeature)
        left, wide = frames_span(corner.x, width)
        first, last = timeline.track.visible_range
        step = wide / (last - first)
        count = len(covered.distances)
        if imgui.is_item_active():
            frame = round(first + (imgui.get_mouse_pos().x - left) / step)
            timeline.go_to(min(max(frame, 0), count - 1))
        draw = imgui.get_window_draw_list()
        high, bottom = (corner.x + width, corner.y + height), corner.y + height
        draw.push_clip_rect(corner, high, True)
        draw.add_rect_filled(corner, high, u32(FIELD))
        top = max(float(covered.distances.max()), 1.5 * covered.limit)
        from_frame, to_frame = max(math.floor(first) - 1, 0), min(math.ceil(last) + 2, count)
        # Where several frames share a pixel column, the farthest one is shown.
        every = max(math.ceil(_NARROWEST / step), 1)
        for frame in range(from_frame - from_frame % every, to_frame, every):
            value = float(covered.distances[frame : frame + every].max())
            tall = max(value / top * (height - 2.0), 1.0)
            x0 = left + (frame - 0.5 - first) * step
            x1 = max(x0 + every * step - 0.5, x0 + 1.0)
            draw.add_rect_filled(
                (x0, bottom - tall), (x1, bottom), u32(WARNING if value > covered.limit else FAINT, 0.85)
            )
        limit = bottom - covered.limit / top * (height - 2.0)
        draw.add_line((corner.x, limit), (high[0], limit), u32(INK, 0.25))
        for marked, line in ((covered.best, KEYED), (context.session.animation.frame, ACCENT)):
            if marked is not None and marked < count:
                x = left + (marked - first) * step
                draw.add_line((x, corner.y), (x, bottom), u32(line), max(em(0.12), 1.0))
        draw.pop_clip_rect()
        tooltip(
            f"{self.text(covered)}\nOrange frames are outside the key poses, the yellow one would help most as a key "
            "pose. Click to go to a frame"
        )
