"""What panels and the view show of a session's constraints, worked out anew only when it has changed."""

from typing import TYPE_CHECKING

from faceposer.solve.conflicts import find_conflicts
from faceposer.solve.problem import PoseProblem
from faceposer.solve.reach import HARDLY_MOVES
from faceposer.viewer.overlay import PinMark, pin_marks
from faceposer.viewer.overlay_marks import ShapeMarks, shape_marks
from faceposer.viewer.point_names import PointNames

if TYPE_CHECKING:
    from faceposer.viewer.app import App


class DrawnConstraints:
    """The constraints of the session of an application as they appear now.

    Attributes:
        names: What people call places of the face.
    """

    def __init__(self, app: "App") -> None:
        """Follow the session that ``app`` has now."""
        self._app = app
        self.names = PointNames(app.session.model.subject)
        self._pins: tuple[object, list[PinMark]] = (None, [])
        self._shapes: tuple[object, ShapeMarks] = (None, ShapeMarks())
        self._conflicts: tuple[object, dict[int, str]] = (None, {})

    def _key(self) -> tuple[object, ...]:
        app = self._app
        return (app.session.revision, app.viewport.view, app.viewport.size, app.toolbox.active)

    @property
    def pins(self) -> list[PinMark]:
        """How the pins appear in the view."""
        key = self._key()
        if key != self._pins[0]:
            self._pins = (key, pin_marks(self._app.viewport, self._app.scene, self._app.toolbox.active))
        return self._pins[1]

    @property
    def shapes(self) -> ShapeMarks:
        """How all other constraints appear in the view."""
        app = self._app
        offers_gaze = app.toolbox.chosen is app.toolbox.gaze_tool
        key = (*self._key(), offers_gaze)
        if key != self._shapes[0]:
            moving = app.toolbox.active
            self._shapes = (key, shape_marks(app.viewport, app.scene, app.toolbox.gaze_tool, offers_gaze, moving))
        return self._shapes[1]

    @property
    def conflicts(self) -> dict[int, str]:
        """What holds constraints back that are not met, by their index; nothing while the face is being pulled."""
        app = self._app
        session, document = app.session, app.session.document
        if app.busy or not document.solved:
            return {}
        if session.revision != self._conflicts[0]:
            problem = PoseProblem(
                session.model,
                document.constraints,
                document.start,
                document.prior_weight,
                prior=document.prior,
                spread=document.spread,
            )
            found = find_conflicts(problem, session.coefficients)
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
                    texts[conflict.index] = f"Fights with {self.names.of(opponent)} ({opponent.kind})."
            self._conflicts = (session.revision, texts)
        return self._conflicts[1]
