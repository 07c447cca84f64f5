"""Trajectories in the window: drawn over the face, solved in the background, and set as keys of the timeline."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

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
from faceposer.gui.features.trajectories.options import ShownTrajectories, TrajectoryOptions
from faceposer.gui.features.trajectories.overlay import TrajectoryOverlay
from faceposer.gui.features.trajectories.panel import draw_trajectory_options
from faceposer.gui.widgets.modal import draw_job, modal
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.progress import Progress
from faceposer.session.jobs import ThreadJob, outcome
from faceposer.session.sketching import prior_of, solver_input
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.priors import Prior
from faceposer.solve.problem import RECORDED_SPREAD, SPREAD

if TYPE_CHECKING:
    from faceposer.tools.trajectory_tool import DrawnTrajectory, TrajectoryTool

Array = NDArray[np.float64]

# Seconds of a solve after which a dialog shows its progress.
_DIALOG_AFTER = 0.3


@dataclass(frozen=True, eq=False)
class TrajectoryRequest:
    """Input of a solve.

    Attributes:
        model: Model of the face.
        trajectories: Trajectories that points of the face follow.
        label: Label of the step in the history.
        first: Frame of the timeline at which the trajectories begin, or None to replace the whole animation.
        options: Options at the time of the request.
        start: Starting pose, shape (r,).
        constraints: Constraints that hold in all frames.
        prior_weight: Weight of the prior.
        prior: Kind of prior.
        spread: Spread of the motion over the face.
    """

    model: FaceModel
    trajectories: Trajectories
    label: str
    first: int | None
    options: TrajectoryOptions
    start: Array
    constraints: tuple[Constraint, ...] = ()
    prior_weight: float = 1.0
    prior: Prior = "regions"
    spread: float = SPREAD


def _solve(request: TrajectoryRequest, progress: Progress) -> Performance:
    # Imported here, because the libraries take a good part of a second to load.
    from faceposer.animation.following import solve_trajectories

    return solve_trajectories(
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
    """Drawn trajectories, and the solve in progress.

    Attributes:
        options: Options of drawn trajectories.
        first: Frame of the timeline at which the drawn trajectories begin.
        job: The solve in progress, or None.
    """

    tool_name = "trajectory"

    def __init__(self, context: EditorContext) -> None:
        super().__init__(context)
        self.options = TrajectoryOptions()
        self.first = 0
        self.job: ThreadJob[Performance] | None = None
        self._request: TrajectoryRequest | None = None
        self._overlay = TrajectoryOverlay(context)

    @property
    def tool(self) -> "TrajectoryTool":
        """The tool that draws trajectories."""
        return self.context.toolbox.trajectory_tool

    @property
    def _shown(self) -> ShownTrajectories:
        return ShownTrajectories(self.tool, self.options, self.first, self.timeline.keyframes.rate, self.positions)

    @property
    def is_modal(self) -> bool:
        """True while the dialog with the progress of a solve is shown."""
        return self.job is not None and self.job.seconds > _DIALOG_AFTER

    @property
    def chosen(self) -> bool:
        """True if the trajectory tool is chosen."""
        return self.context.toolbox.chosen is self.tool

    @property
    def timeline(self) -> TimelineFeature:
        """The timeline that receives the keys."""
        return self.context.feature(TimelineFeature)

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the entries of the menu "Animate"."""
        return [
            Action(
                "follow",
                "Follow trajectories",
                "Animate",
                self.solve_drawn,
                enabled=lambda: bool(self.tool.drawn) and self.job is None and not self.context.busy,
                separated=True,
                help="Animate the face to follow the drawn trajectories, and set the result as keys",
            ),
        ]

    def draw_tool_options(self) -> None:
        """Draw the options of drawn trajectories."""
        draw_trajectory_options(self.context, self._shown)

    def session_changed(self) -> None:
        """Cancel the solve, which belongs to another session."""
        self._cancel_solve()

    def before_press(self) -> None:
        """Go to the first frame of all trajectories before another one is drawn."""
        hover = self.context.toolbox.hover
        draws = self.chosen and hover is not None and hover.surface
        if draws and self.tool.drawn and self.context.session.document.frame != self.first:
            self.timeline.go_to(self.first)
            self.context.scene.set_pose(self.context.session.coefficients, self.context.session.document.contact)

    def update(self) -> None:
        """Start a solve that the tool has requested, and load the result of one that has ended.

        Raises:
            Exception: The error of the solve, unless the user can resolve it; then a dialog reports it.
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
        # One frame only, unlike after an event: the progress advances many times per second.
        self.context.redraw(1)
        if not job.done or self.context.busy:
            return
        self.job = None
        self.context.redraw()
        if job.cancelled:
            return
        result, error = outcome(job, "use fewer frames.")
        if error:
            self.context.dialogs.report("The trajectories were not solved", error)
        elif result is not None and self._request is not None:
            self._load_result(self._request, result)

    # Solving

    def positions(self, drawn: "DrawnTrajectory") -> Array:
        """Return the pixels of ``drawn`` frame by frame, shape (F, 2)."""
        if self.options.timing == "even":
            return drawn.spread(self.options.frames)
        return drawn.timed(self.timeline.keyframes.rate)

    def solve_drawn(self) -> None:
        """Solve for the drawn trajectories; points with a shorter trajectory stay at its end."""
        context, drawn = self.context, self.tool.drawn
        if not drawn or self.job is not None or context.busy:
            return
        self.timeline.go_to(self.first)
        camera = drawn[0].camera
        paths = []
        for trajectory in drawn:
            pixels = trajectory.seen_in(camera)
            if pixels is None:
                raise ValueError("trajectories of different views")
            paths.append(self.positions(replace(trajectory, pixels=pixels)))
        n_frames = min(max(len(path) for path in paths), LONGEST - self.first)
        padded = [np.concatenate([path, np.repeat(path[-1:], max(n_frames - len(path), 0), axis=0)]) for path in paths]
        names = [context.drawn_constraints.names.name(trajectory.anchor) for trajectory in drawn]
        trajectories = Trajectories(
            tuple(names),
            SurfacePoints.of([trajectory.anchor for trajectory in drawn]),
            np.stack([path[:n_frames] for path in padded], axis=1),
            self.timeline.keyframes.rate,
            camera,
        )
        count = "a trajectory" if len(drawn) == 1 else f"{len(drawn)} trajectories"
        self.solve(trajectories, f"Follow {count}", self.first)

    def solve(self, trajectories: Trajectories, label: str, first: int | None) -> None:
        """Solve for ``trajectories`` in the background.

        Args:
            trajectories: Trajectories that the face follows.
            label: Label of the step in the history.
            first: Frame of the timeline at which they begin, or None to replace the whole animation.
        """
        session = self.context.session
        document = session.document
        given, sketched = solver_input(session.model, document)
        constraints = tuple(c for c in given if c.enabled)
        start = session.model.neutral() if sketched is None else sketched
        request = TrajectoryRequest(
            session.model,
            trajectories,
            label,
            first,
            replace(self.options),
            session.coefficients if first is not None and not constraints else start,
            constraints,
            document.prior_weight,
            prior_of(document),
            # Drawn trajectories act like drags; those from a file were recorded on a real face.
            RECORDED_SPREAD if first is None else document.spread,
        )
        self._request = request
        self.job = ThreadJob(partial(_solve, request), self.context.wake)
        self.context.redraw()

    def _load_result(self, request: TrajectoryRequest, performance: Performance) -> None:
        """Set ``performance`` as keys of the timeline, which replace the keys in its frames."""
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
        notes = " ".join(request.trajectories.notes)
        said = f". {notes}" if notes else ""
        self.context.notify(f"Solved {len(performance)} frames and set {counted(solved.keys)}{said}")

    def _cancel_solve(self) -> None:
        """Cancel the solve in progress and wait until it has ended."""
        if self.job is not None:
            self.job.cancel()
            self.job.join()
            self.job = None

    def close(self) -> None:
        """Cancel the solve."""
        self._cancel_solve()

    # Drawing

    def draw_over(self, draw: imgui.ImDrawList) -> None:
        """Draw the trajectories, and the points that the tool snaps to."""
        if self.chosen and not self.context.comparing:
            self._overlay.draw(draw, self._shown)

    def draw_dialog(self) -> None:
        """Draw the progress of the solve, unless another dialog is open above it."""
        if self.job is None or not self.is_modal or self.context.dialogs.open:
            return
        with modal("##following", 26.0) as shown:
            if shown:
                context, title = self.context, "Following trajectories"
                draw_job(context.fonts, context.widget_rects, "following", title, self.job, self.progress)

    @property
    def progress(self) -> str:
        """Current stage of the solve in words."""
        job = self.job
        if job is None:
            return ""
        if job.cancelled:
            return "Stopping..."
        return f"{job.stage}..." if job.share < 1.0 else "Smoothing all frames..."
