"""Trajectories in the window: drawn over the face, then solved beside the frames into keys of the timeline."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Literal

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from faceposer.animation.keyframes import LONGEST, TOLERANCE, Key, Keyframes
from faceposer.animation.trajectories import Trajectories
from faceposer.geometry.picking import SurfacePoints
from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.timeline.editor import counted
from faceposer.gui.features.timeline.feature import TimelineFeature
from faceposer.gui.features.trajectories.overlay import TrajectoryPainter
from faceposer.gui.features.trajectories.panel import draw_trajectory_options
from faceposer.gui.widgets.modal import draw_job, modal
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.progress import Progress
from faceposer.session.jobs import ThreadJob
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.priors import Prior
from faceposer.solve.problem import RECORDED_SPREAD, SPREAD

if TYPE_CHECKING:
    from faceposer.tools.trajectory_tool import DrawnTrajectory, TrajectoryTool

Array = NDArray[np.float64]
Timing = Literal["pen", "even"]

# Seconds after which a dialog tells how far it is.
_DIALOG_AFTER = 0.3


@dataclass
class FollowingOptions:
    """What the user sets.

    Attributes:
        timing: Whether the face goes as fast as the pen went, or at an even pace.
        frames: How many frames an even pace takes, at least 2.
        smoothness: Weight of the changes of velocity.
        few_keys: Whether frames that the others tell of are left out.
    """

    timing: Timing = "pen"
    frames: int = 30
    smoothness: float = 1.0
    few_keys: bool = True


@dataclass(frozen=True, eq=False)
class FollowingRequest:
    """What is solved.

    Attributes:
        model: The face.
        trajectories: What its points follow.
        label: Of the step in the history.
        first: The frame of the timeline at which they begin; None to take the place of the whole animation.
        options: As they were when it was asked for.
        start: The pose where nothing pulls, shape (r,).
        constraints: What holds in all frames.
        prior_weight: Weight of the prior.
        prior: How it judges.
        spread: How much of the face follows.
    """

    model: FaceModel
    trajectories: Trajectories
    label: str
    first: int | None
    options: FollowingOptions
    start: Array
    constraints: tuple[Constraint, ...] = ()
    prior_weight: float = 1.0
    prior: Prior = "regions"
    spread: float = SPREAD


def _solve(request: FollowingRequest, progress: Progress) -> Performance:
    # Here and not above: the libraries behind take a good part of a second to load.
    from faceposer.animation.following import follow

    return follow(
        request.model,
        request.trajectories,
        smoothness=request.options.smoothness,
        prior_weight=request.prior_weight,
        prior=request.prior,
        spread=request.spread,
        start=request.start,
        constraints=request.constraints,
        progress=progress,
    )


class TrajectoriesFeature(Feature):
    """The trajectories that are drawn, and the solve under way.

    Attributes:
        options: What the user sets.
        first: The frame of the timeline at which the drawn trajectories begin.
        job: The solve under way, or None.
    """

    tool_name = "trajectory"

    def __init__(self, context: EditorContext) -> None:
        super().__init__(context)
        self.options = FollowingOptions()
        self.first = 0
        self.job: ThreadJob[Performance] | None = None
        self._request: FollowingRequest | None = None
        self._painter = TrajectoryPainter(context)

    @property
    def tool(self) -> "TrajectoryTool":
        """The tool that draws them."""
        return self.context.toolbox.trajectory_tool

    @property
    def is_modal(self) -> bool:
        """Whether a solve has gone on for long enough to be worth a dialog."""
        return self.job is not None and self.job.seconds > _DIALOG_AFTER

    @property
    def chosen(self) -> bool:
        """Whether trajectories are what one draws now."""
        return self.context.toolbox.chosen is self.tool

    @property
    def timeline(self) -> TimelineFeature:
        """Where the keys go."""
        return self.context.feature(TimelineFeature)

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the entries of the menu "Animate"."""
        return [
            Action(
                "follow",
                "Follow the trajectories",
                "Animate",
                self.solve_drawn,
                enabled=lambda: bool(self.tool.drawn) and self.job is None and not self.context.busy,
                separated=True,
                help="Let the face follow the trajectories that are drawn; the result becomes keys",
            ),
        ]

    def draw_tool_options(self) -> None:
        """Draw the options of drawn trajectories."""
        draw_trajectory_options(self)

    def session_changed(self) -> None:
        """Give up what was for the session before."""
        self.end()

    def before_press(self) -> None:
        """Go to where all trajectories begin, when another one is about to be drawn."""
        hover = self.context.toolbox.hover
        draws = self.chosen and hover is not None and hover.surface
        if draws and self.tool.drawn and self.context.session.document.frame != self.first:
            self.timeline.go_to(self.first)
            self.context.scene.set_pose(self.context.session.coefficients, self.context.session.document.contact)

    def update(self) -> None:
        """Take what has been asked for or solved.

        Raises:
            Exception: What went wrong in the solve, unless the user wanted it.
        """
        self.tool.follow_history(self.context.session.depth)
        if self.chosen and not self.tool.drawn:
            self.first = self.context.session.document.frame
        if self.tool.accepted:
            self.tool.accepted = False
            self.solve_drawn()
        job = self.job
        if job is None:
            return
        # One frame, not several as after an event: the progress moves many times a second.
        self.context.redraw(1)
        if not job.done or self.context.busy:
            return
        self.job = None
        self.context.redraw()
        if job.cancelled:
            return
        if job.error is not None:
            raise job.error
        if job.result is not None and self._request is not None:
            self._take(self._request, job.result)

    # What is solved

    def positions(self, drawn: "DrawnTrajectory") -> Array:
        """Return where the point of ``drawn`` is, frame by frame, shape (F, 2)."""
        if self.options.timing == "even":
            return drawn.spread(self.options.frames)
        return drawn.timed(self.timeline.keyframes.rate)

    def solve_drawn(self) -> None:
        """Let the face follow what is drawn; a point whose trajectory is shorter than others stays at its end."""
        context, drawn = self.context, self.tool.drawn
        if not drawn or self.job is not None or context.busy:
            return
        self.timeline.go_to(self.first)
        camera = drawn[0].camera
        ways = []
        for one in drawn:
            seen = one.seen_in(camera)
            if seen is None:
                raise ValueError("trajectories of different views")
            ways.append(self.positions(replace(one, pixels=seen)))
        n_frames = min(max(len(way) for way in ways), LONGEST - self.first)
        held = [np.concatenate([way, np.repeat(way[-1:], max(n_frames - len(way), 0), axis=0)]) for way in ways]
        names = [context.drawn_constraints.names.name(one.anchor) for one in drawn]
        trajectories = Trajectories(
            tuple(names),
            SurfacePoints.of([one.anchor for one in drawn]),
            np.stack([way[:n_frames] for way in held], axis=1),
            self.timeline.keyframes.rate,
            camera,
        )
        count = "a trajectory" if len(drawn) == 1 else f"{len(drawn)} trajectories"
        self.begin(trajectories, f"Follow {count}", self.first)

    def begin(self, trajectories: Trajectories, label: str, first: int | None) -> None:
        """Let the face follow ``trajectories`` from the frame ``first`` on, or None for an animation of their own."""
        session = self.context.session
        document = session.document
        constraints = tuple(c for c in document.constraints if c.enabled)
        start = session.model.neutral() if document.start is None else document.start
        request = FollowingRequest(
            session.model,
            trajectories,
            label,
            first,
            replace(self.options),
            session.coefficients if first is not None and not constraints else start,
            constraints,
            document.prior_weight,
            document.prior,
            # Drawn by hand, the ways of a few points mean what a drag means; from a file they are a real face's.
            RECORDED_SPREAD if first is None else document.spread,
        )
        self._request = request
        self.job = ThreadJob(partial(_solve, request), self.context.wake)
        self.context.redraw()

    def _take(self, request: FollowingRequest, performance: Performance) -> None:
        """Make ``performance`` keys of the timeline, in place of those that lie in its frames."""
        model = request.model
        dense = Keyframes.of_performance(performance)
        solved = dense.reduced(model, TOLERANCE) if request.options.few_keys else dense
        if request.first is None:
            keyframes = solved
        else:
            before = self.timeline.keyframes
            end = request.first + len(performance)
            replaced = {frame for frame in before.frames if request.first <= frame < end}
            keys = [Key(key.frame + request.first, key.pose) for key in solved.keys]
            length = max(before.length, end) if before.keys else max(end, 2)
            keyframes = replace(before, length=min(length, LONGEST)).without(replaced).with_keys(keys)
        self.context.session.animation.load(keyframes, request.label, request.first or 0)
        self.timeline.present()
        self.context.notify(f"{len(performance)} frames, kept as {counted(solved.keys)}")

    def end(self) -> None:
        """Give up the solve under way and wait for its end."""
        if self.job is not None:
            self.job.cancel()
            self.job.join()
            self.job = None

    def close(self) -> None:
        """End."""
        self.end()

    # Drawing

    def draw_over(self, draw: imgui.ImDrawList) -> None:
        """Draw the trajectories, the points that can be taken, and how far the solve is."""
        if self.chosen and not self.context.comparing:
            self._painter.paint(draw, self)

    def draw_dialog(self) -> None:
        """Draw how far the solve is, unless another dialog is above."""
        if self.job is None or not self.is_modal or self.context.dialogs.open:
            return
        with modal("##following", 26.0) as shown:
            if shown:
                context, title = self.context, "The face follows the trajectories"
                draw_job(context.fonts, context.widget_rects, "following", title, self.job, self.progress)

    @property
    def progress(self) -> str:
        """What the solve under way does now."""
        job = self.job
        if job is None:
            return ""
        if job.cancelled:
            return "Stopping..."
        return f"{job.stage}..." if job.share < 1.0 else "Making all frames smooth together..."
