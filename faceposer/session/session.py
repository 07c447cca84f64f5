"""The document being edited, its history and its solves: what tools and panels change, and what is drawn.

Revision: rises with every change of the document or the pose; compare it to know whether to redraw.
Epoch: rises when results under way no longer matter (undo, redo, cancel, load).
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
from faceposer.session.document import Document, character_from, path_from, write_document
from faceposer.session.history import History
from faceposer.session.solver_worker import InlineWorker, Job, Worker
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.map_solver import Solution
from faceposer.solve.priors import Prior

Mode = Literal["live", "apply"]


class Session:
    """One document with its face, edited one gesture at a time.

    In the mode "live" every change is solved as it happens (the paper's dragging mode); in "apply" the user asks for
    the solve (its "click done" mode).

    Attributes:
        animation: What is done with the keys of the document.
        remark: What opening its file changed, in sentences for the user, because it was made on another version of the
            character; usually empty.
    """

    def __init__(
        self,
        model: FaceModel,
        document: Document,
        worker: Worker | None = None,
        path: Path | None = None,
        remark: str = "",
    ) -> None:
        """Open ``document`` over ``model``.

        Args:
            model: The face that the document names.
            document: What to edit.
            worker: Solves; in the caller's thread if None.
            path: The file that the document came from, if any.
            remark: What opening that file changed.

        Raises:
            FacePoserError: If the document does not fit the face.
        """
        document = document.resolved(model)
        self.model = model
        self.worker: Worker = InlineWorker() if worker is None else worker
        self.path = path
        self.remark = remark
        self.solution: Solution | None = None
        self.revision = 0
        self.epoch = 0
        self._mode: Mode = "live"
        self._document = document
        self._history = History(document)
        self._saved: Document | None = document
        self._editing = False
        self._before_edit = document
        self._residuals: tuple[int, tuple[float, ...]] | None = None
        self.animation = AnimationController(self)
        if document.keyframes is not None and document.solved and document.coefficients is not None:
            self._document = self._saved = self.animation.with_auto_key(document)
            self._history.amend_head(self._document)
        if document.constraints and document.coefficients is None:
            self._document = replace(document, solved=False)
            self._submit(from_here=False)

    # What is shown

    @property
    def document(self) -> Document:
        """The current document."""
        return self._document

    @property
    def coefficients(self) -> NDArray[np.float64]:
        """The current pose, shape (r,)."""
        pose = self._document.coefficients
        return self.model.neutral() if pose is None else pose

    @property
    def vertices(self) -> NDArray[np.float32]:
        """The vertices of the face as it is shown, shape (N, 3)."""
        return self.model.surface(self.coefficients, self._document.contact)

    @property
    def residuals_px(self) -> tuple[float, ...]:
        """How far each constraint is from being met by the current pose, in pixels of its own camera."""
        if self._residuals is None or self._residuals[0] != self.revision:
            pose = self.coefficients
            residuals = tuple(c.residual_px(self.model, pose) for c in self._document.constraints)
            self._residuals = (self.revision, residuals)
        return self._residuals[1]

    @property
    def dirty(self) -> bool:
        """Whether there is something that a save would keep and the file does not have."""
        return self._saved is None or not self._document.same_input(self._saved)

    @property
    def unsaved(self) -> Document | None:
        """The document of the last finished step if a save would keep something of it, or None."""
        head = self._history.head
        return head if self.dirty and (self._saved is None or not head.same_input(self._saved)) else None

    @property
    def editing(self) -> bool:
        """Whether an edit is open."""
        return self._editing

    @property
    def solving(self) -> bool:
        """Whether a solve waits or runs."""
        return self.worker.busy

    @property
    def pending(self) -> bool:
        """Whether the constraints wait for the user to apply them."""
        return not self._document.solved and not self.solving

    # Edits

    @property
    def mode(self) -> Mode:
        """When the face follows: "live", or "apply" only when asked."""
        return self._mode

    @mode.setter
    def mode(self, mode: Mode) -> None:
        self._mode = mode
        self.revision += 1
        self._follow()

    @contextmanager
    def edit(self, label: str, merges: bool = False) -> Iterator[None]:
        """Make everything inside one step of the history, called ``label``; an exception takes it all back.

        With ``merges`` it joins the step before, if that has the same label.

        Raises:
            RuntimeError: If an edit is open already.
        """
        if self._editing:
            raise RuntimeError("an edit is open already")
        before = self._before_edit = self._document
        if before is not self._history.head and before.same_input(self._history.head):
            # Another frame is shown than when the last step was done; undo comes back to this one.
            self._history.amend_head(before)
        self._editing = True
        try:
            yield
        except BaseException:
            self._editing = False
            self._show(before)
            raise
        self._editing = False
        if self._document.coefficients is not before.coefficients:
            self._document = self.animation.with_auto_key(self._document)
            self.revision += 1
        if not self._document.same_input(before) or self._document.coefficients is not before.coefficients:
            self._history.commit(label, self._document, merges)

    def replace(self, document: Document) -> None:
        """Make ``document`` the current one, inside an edit, and let the face follow.

        Raises:
            RuntimeError: If no edit is open.
        """
        if not self._editing:
            raise RuntimeError("documents are replaced inside an edit")
        unmoved = document.same_face(self._document) or document.rests_like(self._document)
        solved = self._document.solved and unmoved
        self._document = replace(document, solved=solved)
        self.revision += 1
        self._follow()

    def set_without_history(self, document: Document) -> None:
        """Show ``document``, whose pose is what it asks for or what the present one has, as it is; keep no step."""
        self.epoch += document.coefficients is not self._document.coefficients
        self._document = document
        self.revision += 1

    def restore(self) -> None:
        """Return to the document from before the open edit, which then leaves no trace in the history.

        Raises:
            RuntimeError: If no edit is open.
        """
        if not self._editing:
            raise RuntimeError("documents are restored inside an edit")
        self._show(self._before_edit)

    def add_constraint(self, constraint: Constraint, label: str) -> None:
        """Add ``constraint`` as one step of the history."""
        with self.edit(label):
            self.replace(replace(self._document, constraints=(*self._document.constraints, constraint)))

    def remove_constraints(self, indices: set[int], label: str) -> None:
        """Remove the constraints ``indices`` as one step; without any left, the face returns to its start pose."""
        kept = tuple(c for i, c in enumerate(self._document.constraints) if i not in indices)
        with self.edit(label):
            self.replace(replace(self._document, constraints=kept))

    def set_prior_weight(self, weight: float) -> None:
        """Change the prior's weight inside an open edit (a slider being dragged), or else as one step."""
        document = replace(self._document, prior_weight=weight)
        if self._editing:
            self.replace(document)
            return
        with self.edit("Change the prior weight"):
            self.replace(document)

    def set_spread(self, spread: float) -> None:
        """Change how much of the face follows a pull, 0 to 1, inside an open edit, or else as one step."""
        document = replace(self._document, spread=spread)
        if self._editing:
            self.replace(document)
            return
        with self.edit("Change the spread"):
            self.replace(document)

    def set_prior(self, prior: Prior) -> None:
        """Evaluator the face by regions or as a whole, as one step."""
        with self.edit("Change the prior"):
            self.replace(replace(self._document, prior=prior))

    def set_contact(self, contact: bool) -> None:
        """Turn the contact step on or off, as one step; the pose stays."""
        if contact != self._document.contact:
            with self.edit("Turn contact on" if contact else "Turn contact off"):
                self.set_without_history(replace(self._document, contact=contact))

    def change_constraint(self, index: int, constraint: Constraint, label: str) -> None:
        """Exchange constraint ``index`` inside an open edit (a slider being dragged), or else as one step."""
        document = self._document.with_constraint(index, constraint)
        if self._editing:
            self.replace(document)
            return
        with self.edit(label):
            self.replace(document)

    def set_start(self, start: NDArray[np.float64]) -> None:
        """Change the pose that the face starts from, shape (r,), inside an open edit, as the slider of a shape does."""
        document = self._document.starting_from(start)
        if document.constraints:
            self.replace(document)
            return
        # Nothing pulls: the pose is the start, and nothing is left to solve.
        self._document = document.posed(start)
        self.epoch += 1
        self.revision += 1

    def accept_pose(self) -> None:
        """Make the current face the one that editing starts from, without constraints, as one step."""
        self.rebase_pose(self.coefficients, "Accept the pose")

    def rebase_pose(self, pose: NDArray[np.float64], label: str) -> None:
        """Make ``pose``, shape (r,), the one that editing starts from, without constraints, as one step."""
        with self.edit(label):
            self.epoch += 1
            self._document = replace(self._document, constraints=()).starting_from(pose).posed(pose)
            self.revision += 1

    def reset_pose(self) -> None:
        """Return to the neutral face without constraints, as one step."""
        with self.edit("Reset to neutral"):
            self.epoch += 1
            self.solution = None
            self._document = replace(self._document, constraints=(), start=None).posed(self.model.neutral())
            self.revision += 1

    def apply(self) -> None:
        """Solve for the current constraints from the best start, as one step (the paper's "click done")."""
        if self._editing:
            return
        self._history.commit("Apply", self._document)
        self._submit(from_here=False)

    # History

    @property
    def undo_label(self) -> str | None:
        """What undo would take back, or None."""
        return self._history.undo_label

    @property
    def redo_label(self) -> str | None:
        """What redo would do again, or None."""
        return self._history.redo_label

    @property
    def depth(self) -> int:
        """How many steps of the history lead to the document: undo makes it one less, redo one more."""
        return self._history.depth

    @property
    def can_undo(self) -> bool:
        """Whether there is something to take back."""
        return not self._editing and self.undo_label is not None

    @property
    def can_redo(self) -> bool:
        """Whether there is something to do again."""
        return not self._editing and self.redo_label is not None

    def undo(self) -> None:
        """Take back the last step; nothing happens while an edit is open."""
        if self.can_undo:
            self._show(self._history.undo())

    def redo(self) -> None:
        """Do the last undone step again; nothing happens while an edit is open."""
        if self.can_redo:
            self._show(self._history.redo())

    def _show(self, document: Document) -> None:
        """Return to a snapshot: constraints and pose together, with nothing left to solve."""
        self.epoch += 1
        self._document = document
        self.revision += 1
        self._follow()

    # Solving

    def _follow(self) -> None:
        """Let the face follow the constraints if it is to do so by itself."""
        if self._mode == "live" and not self._document.solved:
            self._submit()

    def _submit(self, from_here: bool = True) -> None:
        self.worker.submit(replace(self.whole_job(), x0=self.coefficients) if from_here else self.whole_job())

    def whole_job(self) -> Job:
        """Return the job of solving the current document from the best of all starts."""
        return Job(self.epoch, self.revision, self.model, self._document, None)

    def poll(self) -> bool:
        """Take what the worker has finished and return whether the pose changed.

        Raises:
            Exception: Whatever ended a solve of the current epoch.
        """
        result = self.worker.poll()
        if result is None or result.job.epoch != self.epoch:
            return False
        if result.error is not None:
            raise result.error
        assert result.solution is not None
        self.solution = result.solution
        self._document = self._document.posed(result.solution.coefficients)
        if not self._editing:
            self._document = self.animation.with_auto_key(self._document)
            self._history.amend_head(self._document)
        self.revision += 1
        return True

    def wait(self, timeout: float = 10.0) -> None:
        """Wait until nothing is left to solve and take the result.

        Raises:
            FacePoserError: If that takes longer than ``timeout`` seconds.
        """
        if not self.worker.wait_idle(timeout):
            raise FacePoserError(f"The solve did not end within {timeout:g} s.")
        self.poll()

    # Files

    def save(self, path: Path, camera: Camera | None = None) -> None:
        """Write the session file ``path`` with the view ``camera``, if given, and remember it.

        Raises:
            FacePoserError: If the file cannot be written.
        """
        written = replace(
            self._document,
            character=character_from(self._document.character, path.parent),
            photos=tuple(replace(photo, path=path_from(photo.path, path.parent)) for photo in self._document.photos),
        )
        written = written if camera is None else replace(written, camera=camera)
        write_document(path, written.stamped(self.model))
        self.path = path
        self._saved = self._document
        self.revision += 1

    def mark_unsaved(self) -> None:
        """Let the document count as not saved until it is: it is not what its file holds."""
        self._saved = None
        self.revision += 1

    def close(self) -> None:
        """End the worker."""
        self.worker.close()
