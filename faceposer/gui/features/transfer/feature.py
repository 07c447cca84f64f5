"""Carrying the pose to another character: what the dialog has chosen, and what comes of it."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.atomic import write_text
from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.transfer.dialog import TransferDialog
from faceposer.model.face_model import FaceModel
from faceposer.render.scene import Scene
from faceposer.session.document import Document
from faceposer.session.opening import load_model, session_of
from faceposer.session.session import Session
from faceposer.session.solver_worker import Worker
from faceposer.session.transferred import transferred
from faceposer.transfer.pairs import DEFAULT_PAIRS, Pair, pairs_to_json, read_pairs
from faceposer.transfer.terms import PairPoints
from faceposer.transfer.transfer import Method, make_transfer

Array = NDArray[np.float64]


class TransferFeature(Feature):
    """The dialog's state.

    Attributes:
        open: Whether the dialog is shown.
        to: Name or path of the character that gets the expression.
        method: The way.
        pairs: Distances to keep, for the user to edit.
        error: Why there is no result, one sentence, or "".
        target: The face that gets the expression, or None where it cannot be had.
        result: Its pose, shape (r,), or None.
        added: Feature points of the pair that could be added.
    """

    def __init__(self, context: EditorContext) -> None:
        """Serve ``context``."""
        super().__init__(context)
        self.open = False
        self.to = ""
        self.method: Method = "distances"
        self.pairs: tuple[Pair, ...] = DEFAULT_PAIRS
        self.error = ""
        self.target: FaceModel | None = None
        self.result: Array | None = None
        self.added = ["8.3", "8.4"]
        self.characters: list[tuple[str, str]] = []
        self.lengths: tuple[list[float | None], list[float | None]] = ([], [])
        self._asked: object = None
        self._scenes: tuple[Scene, Scene] | None = None
        self._dialog = TransferDialog(self)

    @property
    def is_modal(self) -> bool:
        """Whether the dialog keeps the pointer from the view."""
        return self.open

    def actions(self) -> list[Action | Submenu]:
        """Return the entry in the menu "Edit"."""
        return [
            Action(
                "transfer",
                "Transfer expression to...",
                "Edit",
                self.show,
                enabled=lambda: not self.context.busy,
                separated=True,
                help="Carry this pose to another character, whatever its mesh looks like",
            )
        ]

    # The dialog

    def show(self) -> None:
        """Open the dialog."""
        context = self.context
        context.toolbox.finish()
        context.slider_edit.let_go()
        known = context.characters.all(context.settings.characters)
        listed = {one.name: one.title for one in known}
        # Files that were chosen here stay in the list.
        listed |= {name: title for name, title in self.characters if name not in listed and Path(name).is_file()}
        self.characters = list(listed.items())
        here = context.session.document.character
        if self.to in ("", here):
            self.to = next((name for name, _ in self.characters if name != here), here)
        self.open, self._asked = True, None
        context.redraw()

    def hide(self) -> None:
        """Put the dialog away; what was chosen is there the next time."""
        self.open = False
        self.context.redraw()

    def session_changed(self) -> None:
        """Begin anew for another face."""
        self._asked = None

    def draw_dialog(self) -> None:
        """Draw the dialog, unless another lies over it."""
        if self.open and not (self.context.dialogs.open or self.context.file_dialogs.open):
            self.update()
            self._dialog.draw()

    def choose_file(self, path: Path) -> None:
        """Carry the expression to the character in the file ``path``."""
        self.to = str(path)
        if all(name != self.to for name, _ in self.characters):
            self.characters = [*self.characters, (self.to, path.stem)]

    # Pairs

    def enable(self, index: int, on: bool) -> None:
        """Let the pair ``index`` count or not."""
        changed = replace(self.pairs[index], enabled=on)
        self.pairs = (*self.pairs[:index], changed, *self.pairs[index + 1 :])

    def remove(self, index: int) -> None:
        """Take the pair ``index`` out of the list."""
        self.pairs = (*self.pairs[:index], *self.pairs[index + 1 :])

    def add(self) -> None:
        """Add the pair of the two feature points that are chosen, at the top, where it is seen."""
        first, second = self.added
        titles = self.context.session.model.character.feature_titles
        name = f"{titles.get(first, first)} to {titles.get(second, second)}"
        if not any({first, second} == {pair.first, pair.second} for pair in self.pairs):
            self.pairs = (Pair(name, first, second), *self.pairs)

    def load_pairs(self, path: Path) -> None:
        """Take the list of pairs in the file ``path``."""
        try:
            self.pairs = read_pairs(path)
        except FacePoserError as error:
            self.context.dialogs.report("These pairs cannot be used", str(error))

    def save_pairs(self, path: Path) -> None:
        """Write the list of pairs to the file ``path``."""
        try:
            write_text(path, json.dumps(pairs_to_json(self.pairs), indent=1) + "\n", "list of pairs")
        except FacePoserError as error:
            self.context.dialogs.report("The pairs are not saved", str(error))
            return
        self.context.notify(f"Saved {path.name}")

    # What comes of it

    def update(self) -> None:
        """Carry the pose over if anything has changed since the last time."""
        session = self.context.session
        asked = (self.to, self.method, self.pairs, session.revision, id(session))
        if asked == self._asked:
            return
        self._asked = asked
        self.error, self.result = "", None
        source, pose = session.model, session.coefficients
        try:
            self.target = load_model(self.to)
            self.result = make_transfer(source, self.target, self.method, self.pairs).pose(pose)
        except FacePoserError as error:
            self.error = str(error)
        poses = (pose, self.result)
        self.lengths = (self._measured(source, poses[0]), self._measured(self.target, poses[1]))
        self.context.redraw()

    def _measured(self, model: FaceModel | None, pose: Array | None) -> list[float | None]:
        """Return the distance of each pair on the face ``pose`` of ``model``, None where there is none."""
        if model is None or pose is None:
            return [None] * len(self.pairs)
        there = [pair for pair in self.pairs if pair.measurable(model.character)]
        if not there:
            return [None] * len(self.pairs)
        known = dict(zip(there, PairPoints(model, there).distances(pose[None])[0].tolist(), strict=True))
        return [known.get(pair) for pair in self.pairs]

    @property
    def scenes(self) -> tuple[Scene, Scene]:
        """What draws the two small pictures, of the source and of the target."""
        if self._scenes is None:
            self._scenes = (Scene(self.context.gl), Scene(self.context.gl))
        return self._scenes

    def accept(self) -> None:
        """Edit the result as a new session, after asking about changes that are not saved."""
        if self.result is None or self.target is None:
            return
        self.hide()
        session = self.context.session
        transfer = make_transfer(session.model, self.target, self.method, self.pairs)
        document = transferred(session.document, session.coefficients, transfer, self.to, self.target)
        self.context.guard_changes(lambda: self._open(document))

    def _open(self, document: Document) -> None:
        def opening(worker: Worker) -> Session:
            session = session_of(document, None, worker)
            session.mark_unsaved()
            return session

        if self.context.show_session(opening, "The expression cannot be carried over"):
            moving = document.keyframes is not None and document.keyframes.keys
            self.context.notify(f"A new {'animation' if moving else 'pose'}, not saved yet")

    def close(self) -> None:
        """Free the pictures."""
        for scene in self._scenes or ():
            scene.release()
        self._scenes = None
