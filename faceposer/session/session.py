"""A session: the edited document with its history and its solves.

Revision: incremented by every change of the document or the pose; a new value calls for a redraw.
Epoch: incremented when running solves become obsolete (undo, redo, cancel, load).
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.session.animating import AnimationController
from faceposer.session.document import Document
from faceposer.session.head_edits import HeadEdits, head_model
from faceposer.session.history import History
from faceposer.session.report import Residuals
from faceposer.session.saved_state import SavedState
from faceposer.session.setting_edits import SettingEdits
from faceposer.session.solver_worker import InlineWorker, SolveRequest, Worker
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.map_solver import Solution, SolveError

Mode = Literal["live", "apply"]


class Session(SettingEdits, HeadEdits):
    """A document with its face model, edited one gesture at a time.

    Changes are solved at once in the mode "live" (the paper's dragging), and on request in "apply" ("click done").

    Attributes:
        base_model: Face model of the document's character before its head was edited.
        animation: Frame changes and key edits.
        remark: Sentences for the user on how the file was adapted to another version of its character; usually empty.
    """

    def __init__(
        self,
        model: FaceModel,
        document: Document,
        worker: Worker | None = None,
        path: Path | None = None,
        remark: str = "",
        content: str | None = None,
    ) -> None:
        """Open ``document`` with ``model``.

        Args:
            model: Face model of the document's character, before its head is edited.
            document: Document to edit.
            worker: Solver; None to solve in the caller's thread.
            path: Session file of the document, if any.
            remark: Changes made when the file was opened.
            content: Digest of the content of that file (``content_of``).

        Raises:
            FacePoserError: If the document does not fit the model.
        """
        self.base_model = model
        self.worker: Worker = InlineWorker() if worker is None else worker
        self.path = path
        self.remark = remark
        self.solution: Solution | None = None
        self._failure: SolveError | None = None
        self.revision = self.epoch = 0
        self._mode: Mode = "live"
        self._document = document.resolved(head_model(model, document.identity))
        self.animation = AnimationController(self)
        self._document = document = self.animation.as_opened(self._document)
        self._history = History(document)
        self._saved = SavedState(document, content)
        self._editing = False
        self._before_edit = document
        self._residuals = Residuals()
        if document.constraints and document.coefficients is None:
            self._document = replace(document, solved=False)
            self._submit(warm_start=False)

    # Displayed state

    @property
    def document(self) -> Document:
        """The current document."""
        return self._document

    @property
    def model(self) -> FaceModel:
        """Face model of the document's character with its edited head; another object after each edit of the head."""
        return head_model(self.base_model, self._document.identity)

    @property
    def coefficients(self) -> NDArray[np.float64]:
        """The current pose, shape (r,)."""
        pose = self._document.coefficients
        return self.model.neutral() if pose is None else pose

    @property
    def vertices(self) -> NDArray[np.float32]:
        """The vertices of the displayed face, shape (N, 3)."""
        return self.model.surface(self.coefficients, self._document.contact)

    @property
    def residuals_px(self) -> tuple[float, ...]:
        """Error of each constraint at the current pose, in pixels of its camera."""
        return self._residuals.at(self.revision, self.model, self._document.constraints, self.coefficients)

    @property
    def dirty(self) -> bool:
        """True if the document has changes that are not in the file."""
        return self._saved.differs_from(self._document)

    @property
    def unsaved(self) -> Document | None:
        """The document of the last finished step, or None if it has no unsaved changes."""
        head = self._history.head
        return head if self.dirty and self._saved.differs_from(head) else None

    @property
    def editing(self) -> bool:
        """True if an edit is open."""
        return self._editing

    @property
    def solving(self) -> bool:
        """True if a solve is queued or running."""
        return self.worker.busy

    @property
    def pending(self) -> bool:
        """True if the constraints have changed since the last solve and no solve is running."""
        return not self._document.solved and not self.solving

    # Edits

    @property
    def mode(self) -> Mode:
        """Solve mode: "live" for every change, or "apply" on request."""
        return self._mode

    @mode.setter
    def mode(self, mode: Mode) -> None:
        self._mode = mode
        self.revision += 1
        self._solve_if_live()

    @contextmanager
    def edit(self, label: str, merges: bool = False) -> Iterator[None]:
        """Make all changes inside the block one step of the history, named ``label``; an exception reverts them.

        With ``merges``, the step is merged with the previous one if that has the same label.

        Raises:
            RuntimeError: If an edit is already open.
        """
        if self._editing:
            raise RuntimeError("an edit is already open")
        before = self._before_edit = self._document
        if before is not self._history.head and before.same_input(self._history.head):
            # The frame was changed since the last step: undo returns to the present frame.
            self._history.replace_head(before)
        self._editing = True
        try:
            yield
        except BaseException:
            self._editing = False
            self._show_snapshot(before)
            raise
        self._editing = False
        if self._document.coefficients is not before.coefficients:
            self._document = self.animation.with_auto_key(self._document)
            self.revision += 1
        if not self._document.same_input(before) or self._document.coefficients is not before.coefficients:
            self._history.commit(label, self._document, merges)

    def replace(self, document: Document) -> None:
        """Replace the document inside an edit, and solve in the mode "live".

        Raises:
            RuntimeError: If no edit is open.
        """
        if not self._editing:
            raise RuntimeError("documents are replaced inside an edit")
        unmoved = document.same_face(self._document) or document.same_unconstrained_pose(self._document)
        solved = self._document.solved and unmoved
        self._document = replace(document, solved=solved)
        self.revision += 1
        self._solve_if_live()

    def _change(self, document: Document, label: str) -> None:
        """Replace the document inside the open edit, such as the drag of a slider, or else as one step."""
        if self._editing:
            self.replace(document)
            return
        with self.edit(label):
            self.replace(document)

    def set_without_history(self, document: Document) -> None:
        """Show ``document`` as it is, with a pose that is solved or unchanged, without a step of the history."""
        self.epoch += document.coefficients is not self._document.coefficients
        self._document = document
        self.revision += 1

    def restore(self) -> None:
        """Restore the document from before the open edit, which then leaves no step in the history.

        Raises:
            RuntimeError: If no edit is open.
        """
        if not self._editing:
            raise RuntimeError("documents are restored inside an edit")
        self._show_snapshot(self._before_edit)

    def add_constraint(self, constraint: Constraint, label: str) -> None:
        """Add ``constraint`` as one step."""
        with self.edit(label):
            self.replace(replace(self._document, constraints=(*self._document.constraints, constraint)))

    def remove_constraints(self, indices: set[int], label: str) -> None:
        """Remove the constraints ``indices`` as one step; without constraints, the face returns to its start pose."""
        with self.edit(label):
            self.replace(self._document.without_constraints(indices))

    def change_constraint(self, index: int, constraint: Constraint, label: str) -> None:
        """Replace constraint ``index``, inside the open edit or as one step."""
        self._change(self._document.with_constraint(index, constraint), label)

    def set_start(self, start: NDArray[np.float64]) -> None:
        """Change the start pose of the face, shape (r,), inside an open edit, such as the drag of a shape's slider."""
        document = self._document.with_start(start)
        if document.constraints:
            self.replace(document)
            return
        # Without constraints, the start is the pose: there is nothing to solve.
        self._document = document.posed(start)
        self.epoch += 1
        self.revision += 1

    def accept_pose(self) -> None:
        """Make the current pose the start pose, without constraints, as one step."""
        self.rebase_pose(self.coefficients, "Accept the pose")

    def rebase_pose(self, pose: NDArray[np.float64], label: str) -> None:
        """Make ``pose``, shape (r,), the start pose, without constraints, as one step."""
        with self.edit(label):
            self.epoch += 1
            self._document = replace(self._document, constraints=()).with_start(pose).posed(pose)
            self.revision += 1

    def reset_pose(self) -> None:
        """Return to the neutral face without constraints, as one step."""
        with self.edit("Reset to neutral"):
            self.epoch += 1
            self.solution = None
            self._document = replace(self._document, constraints=(), start=None).posed(self.model.neutral())
            self.revision += 1

    def apply(self) -> None:
        """Solve for the current constraints from the best start pose, as one step (the "click done" of the paper)."""
        if self._editing:
            return
        self._history.commit("Apply", self._document)
        self._submit(warm_start=False)

    # History

    @property
    def undo_label(self) -> str | None:
        """Label of the step that undo reverts, or None."""
        return self._history.undo_label

    @property
    def redo_label(self) -> str | None:
        """Label of the step that redo repeats, or None."""
        return self._history.redo_label

    @property
    def depth(self) -> int:
        """Number of steps that lead to the document; undo decrements it, redo increments it."""
        return self._history.depth

    @property
    def can_undo(self) -> bool:
        """True if a step can be undone."""
        return not self._editing and self.undo_label is not None

    @property
    def can_redo(self) -> bool:
        """True if a step can be redone."""
        return not self._editing and self.redo_label is not None

    def undo(self) -> None:
        """Undo the last step; has no effect while an edit is open."""
        if self.can_undo:
            self._show_snapshot(self._history.undo())

    def redo(self) -> None:
        """Redo the last undone step; has no effect while an edit is open."""
        if self.can_redo:
            self._show_snapshot(self._history.redo())

    def _show_snapshot(self, document: Document) -> None:
        """Return to a snapshot with its constraints and its pose; it needs no solve."""
        self.epoch += 1
        self._document = document
        self.revision += 1
        self._solve_if_live()

    # Solving

    def _solve_if_live(self) -> None:
        """Solve for the constraints in the mode "live", unless they are solved."""
        if self._mode == "live" and not self._document.solved:
            self._submit()

    def _submit(self, warm_start: bool = True) -> None:
        start = self.coefficients if warm_start else None
        self.worker.submit(SolveRequest(self.epoch, self.revision, self.model, self._document, start))

    def poll(self) -> bool:
        """Accept the result of the worker, if any; return True if the pose changed.

        Constraints that have no solution leave the pose as it is; ``wait`` reports them.

        Raises:
            Exception: Any other error of a solve of the current epoch.
        """
        result = self.worker.poll()
        if result is None or result.job.epoch != self.epoch:
            return False
        self._failure = result.error if isinstance(result.error, SolveError) else None
        if self._failure is not None:
            self.solution = None
            return False
        if result.error is not None:
            raise result.error
        assert result.solution is not None
        self.solution = result.solution
        self._document = self._document.posed(result.solution.coefficients)
        if not self._editing:
            self._document = self.animation.with_auto_key(self._document)
            self._history.replace_head(self._document)
        self.revision += 1
        if self._document.constraints is result.job.document.constraints:
            self._residuals.keep(self.revision, result.solution.residuals_px)
        return True

    def wait(self, timeout: float = 10.0) -> None:
        """Wait for the end of all solves and accept the result.

        Raises:
            FacePoserError: If that takes longer than ``timeout`` seconds, or the constraints have no solution.
        """
        if not self.worker.wait_idle(timeout):
            raise FacePoserError(f"The solve did not end within {timeout:g} s.")
        self.poll()
        if self._failure is not None:
            raise self._failure

    # File

    def save(self, path: Path, camera: Camera | None = None) -> None:
        """Write the session file ``path``, with the view ``camera`` if given, and make it the file of the session.

        Raises:
            FacePoserError: If the file cannot be written.
        """
        self._saved.save(self._document, path, self.model, camera)
        self.path = path
        self.revision += 1

    def changed_on_disk(self) -> bool:
        """Return True if another program has changed the session file since it was opened or saved here."""
        return self.path is not None and self._saved.changed_on_disk(self.path)

    def mark_unsaved(self) -> None:
        """Mark the document as unsaved: it differs from its file."""
        self._saved.mark_unsaved()
        self.revision += 1

    def mark_saved(self) -> None:
        """Mark the document as saved: its pose was written elsewhere, such as to a pose file."""
        self._saved.mark_saved(self._document)
        self.revision += 1

    def close(self) -> None:
        """Stop the worker."""
        self.worker.close()
