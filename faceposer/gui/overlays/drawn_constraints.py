"""Marks, names and conflicts of a session's constraints, recomputed only after changes."""

from collections.abc import Callable

from faceposer.gui.overlays.hidden_marks import HiddenMarks
from faceposer.gui.overlays.marks import Mark, MarkView, mark_of
from faceposer.gui.overlays.marks.gaze import handle_mark
from faceposer.gui.overlays.pins import PinMark, pin_marks
from faceposer.gui.viewport import Viewport
from faceposer.render.scene import Scene
from faceposer.session.place_names import PointNames
from faceposer.session.session import Session
from faceposer.session.sketching import pose_problem
from faceposer.solve.conflicts import find_conflicts
from faceposer.solve.reach import HARDLY_MOVES
from faceposer.tools.toolbox import Toolbox


class DrawnConstraints:
    """The constraints of a session as panels and the view show them.

    Attributes:
        names: Names of locations on the face.
        hidden: Constraints hidden in the view by the user.
    """

    def __init__(
        self, session: Session, scene: Scene, viewport: Viewport, toolbox: Toolbox, busy: Callable[[], bool]
    ) -> None:
        """Show ``session``; ``busy`` returns True while its document is being changed."""
        self._session, self._scene, self._viewport, self._toolbox = session, scene, viewport, toolbox
        self._busy = busy
        self.names = PointNames(session.model.character)
        self.hidden = HiddenMarks()
        self._residuals: tuple[tuple[str, ...], tuple[float, ...]] = ((), ())
        self._pins: tuple[object, list[PinMark]] = (None, [])
        self._marks: tuple[object, dict[int | None, Mark]] = (None, {})
        self._conflicts: tuple[object, dict[int, str]] = (None, {})
        self._titles: tuple[object, list[str]] = (None, [])

    def model_changed(self) -> None:
        """Name locations on the session's present model."""
        self.names = PointNames(self._session.model.character)
        self._titles = (None, [])

    def _key(self) -> tuple[object, ...]:
        return (self._session.revision, self._viewport.view, self._viewport.size, self._toolbox.active)

    @property
    def titles(self) -> list[str]:
        """Names of the locations of all constraints, which tell them apart."""
        constraints = self._session.document.constraints
        if constraints is not self._titles[0]:
            self._titles = (constraints, self.names.all_of(constraints))
        return self._titles[1]

    @property
    def residuals_px(self) -> tuple[float | None, ...]:
        """Error of each constraint at the pose solved last, in pixels of its camera; None if it is being solved."""
        session, constraints = self._session, self._session.document.constraints
        kinds = tuple(constraint.kind for constraint in constraints)
        if session.document.solved or not session.solving:
            self._residuals = (kinds, session.residuals_px)
        known = dict(enumerate(zip(*self._residuals, strict=True)))
        return tuple(known[i][1] if i in known and known[i][0] == kind else None for i, kind in enumerate(kinds))

    @property
    def pins(self) -> list[PinMark]:
        """Marks of the pins in the view."""
        key = self._key()
        if key != self._pins[0]:
            self._pins = (key, pin_marks(self._viewport, self._scene, self._toolbox.active))
        return self._pins[1]

    @property
    def marks(self) -> dict[int | None, Mark]:
        """Marks of all other constraints by index; None is the key of the gaze handle before there is a constraint."""
        toolbox = self._toolbox
        shows_gaze = toolbox.chosen is toolbox.gaze_tool
        key = (*self._key(), shows_gaze)
        if key != self._marks[0]:
            view = MarkView(self._viewport, self._scene, toolbox.active)
            created = ((i, mark_of(i, c, view)) for i, c in enumerate(self._session.document.constraints))
            marks: dict[int | None, Mark] = {i: mark for i, mark in created if mark is not None}
            gaze = toolbox.gaze_tool
            if shows_gaze and gaze.constraint(self._viewport) is None:
                handle = handle_mark(None, gaze.direction(self._viewport), view)
                if handle is not None:
                    marks[None] = handle
            self._marks = (key, marks)
        return self._marks[1]

    @property
    def conflicts(self) -> dict[int, str]:
        """Reasons why constraints are not met, by index; empty while the document is being changed."""
        session, document = self._session, self._session.document
        if self._busy() or not document.solved:
            return {}
        if session.revision != self._conflicts[0]:
            found = find_conflicts(pose_problem(session.model, document), session.coefficients)
            texts = {}
            for conflict in found:
                if conflict.mobility is not None and conflict.mobility < HARDLY_MOVES:
                    texts[conflict.index] = "Not reached: this part of the face hardly moves."
                elif conflict.mobility is not None:
                    texts[conflict.index] = "Not reached: this part of the face cannot move that far."
                elif conflict.opponent is None:
                    texts[conflict.index] = "Not reached: beyond this face's natural range."
                else:
                    opponent = document.constraints[conflict.opponent]
                    texts[conflict.index] = f"Conflicts with {self.titles[conflict.opponent]} ({opponent.noun})."
            self._conflicts = (session.revision, texts)
        return self._conflicts[1]
