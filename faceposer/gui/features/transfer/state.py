"""Transfer of the pose to another character: the state of the dialog, and the result."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.files import paths
from faceposer.gui.context import EditorContext
from faceposer.gui.features.keys.feature import KeysFeature
from faceposer.model.face_model import FaceModel
from faceposer.render.scene import Scene
from faceposer.session.document import Document
from faceposer.session.key_set import KeySet
from faceposer.session.keys import check_same_rig
from faceposer.session.opening import session_for
from faceposer.session.session import Session
from faceposer.session.solver_worker import Worker
from faceposer.session.transferred import transferred
from faceposer.transfer.key_coverage import reach_of
from faceposer.transfer.pairs import DEFAULT_PAIRS, Pair, read_pairs, write_pairs
from faceposer.transfer.source_heads import HeadTransfer
from faceposer.transfer.terms import PairPoints
from faceposer.transfer.transfer import Method, Transfer

Array = NDArray[np.float64]


class TransferState:
    """State of the transfer dialog.

    Attributes:
        context: The editor.
        open: True while the dialog is shown.
        to: Name or path of the target character.
        method: Transfer method.
        pairs: Distances to preserve, edited by the user.
        reach: Distance of the pose from the keys by which it is transferred, and a remark, one sentence each, or "".
        error: Reason why there is no result, one sentence, or "".
        target: Model of the target character, or None if it cannot be loaded.
        result: Pose of the target, shape (r,), or None.
        added: Feature points of the pair that the button Add would add.
        characters: Names and titles of the target characters.
        lengths: Length of each pair on the source and on the target, None where it cannot be measured.
    """

    def __init__(self, context: EditorContext) -> None:
        """Serve ``context``."""
        self.context = context
        self.open = False
        self.to = ""
        self.method: Method = "distances"
        self.pairs: tuple[Pair, ...] = DEFAULT_PAIRS
        self.reach = ("", "")
        self.error = ""
        self.target: FaceModel | None = None
        self.result: Array | None = None
        self.added = ["8.3", "8.4"]
        self.characters: list[tuple[str, str]] = []
        self.lengths: tuple[list[float | None], list[float | None]] = ([], [])
        # True if the user chose the target, which the open key poses do not change then.
        self._chosen = False
        self._last_input: object = None
        self._transfer: Transfer | None = None
        self._scenes: tuple[Scene, Scene] | None = None

    # The dialog

    def show(self) -> None:
        """Open the dialog."""
        context = self.context
        context.toolbox.finish()
        context.slider_edit.let_go()
        library = context.characters.all(context.settings.characters)
        listed = {entry.name: entry.title for entry in library}
        # Keep files that were chosen in the dialog.
        listed |= {name: title for name, title in self.characters if name not in listed and paths.is_file(name)}
        self.characters = list(listed.items())
        source = context.session.document.character
        if self.to in ("", source):
            self.to = next((name for name, _ in self.characters if name != source), source)
            self._chosen = False
        self.open, self._last_input = True, None
        if self.method == "examples":
            self.choose_method("examples")
        context.redraw()

    def choose_method(self, method: Method) -> None:
        """Choose how expressions are transferred; the key poses of the last run are opened when they are needed."""
        self.method = method
        if method == "examples":
            self.by_keys.opened.open_last()

    def choose_target(self, name: str) -> None:
        """Choose the character ``name`` as the target."""
        self.to, self._chosen = name, True

    def _follow_keys(self) -> None:
        """Choose the target of the open key poses of this character, unless the user has chosen one."""
        keys = self.by_keys.opened.keys
        if self.method != "examples" or self._chosen or keys is None:
            return
        if keys.is_of("source", self.context.session.model):
            self.choose_target_of_keys()

    @property
    def target_of_keys(self) -> tuple[str, str] | None:
        """Name or file, and title, of the target of the open key poses, if it is another one than is chosen."""
        keys = self.by_keys.opened.keys
        target = None if keys is None else keys.models["target"]
        if keys is None or target is None or keys.folder.is_mesh:
            return None
        name = keys.folder.character("target")
        chosen = self.to == name or (Path(self.to).suffix and paths.same_file(name, self.to))
        return None if chosen else (name, target.character.title)

    def choose_target_of_keys(self) -> None:
        """Choose the target of the open key poses."""
        target = self.target_of_keys
        if target is not None:
            name, title = target
            self.to = name
            if name not in dict(self.characters):
                self.characters = [*self.characters, (name, title)]

    def new_keys(self) -> None:
        """Ask for a new folder of key poses for the chosen target, in another dialog, and come back to this one."""
        self.hide()
        self.by_keys.ask_for_new(self.to, self.show)

    def hide(self) -> None:
        """Close the dialog; its choices are kept."""
        self.open = False
        self.context.redraw()

    def choose_file(self, path: Path) -> None:
        """Choose the character in the file ``path`` as the target."""
        self.choose_target(str(path))
        if all(name != self.to for name, _ in self.characters):
            self.characters = [*self.characters, (self.to, path.stem)]

    # Pairs

    def enable(self, index: int, on: bool) -> None:
        """Enable or disable the pair ``index``."""
        changed = replace(self.pairs[index], enabled=on)
        self.pairs = (*self.pairs[:index], changed, *self.pairs[index + 1 :])

    def remove(self, index: int) -> None:
        """Remove the pair ``index`` from the list."""
        self.pairs = (*self.pairs[:index], *self.pairs[index + 1 :])

    def add(self) -> None:
        """Add the pair of the two chosen feature points at the top of the list, where it is visible."""
        first, second = self.added
        titles = self.context.session.model.character.feature_titles
        name = f"{titles.get(first, first)} to {titles.get(second, second)}"
        if not any({first, second} == {pair.first, pair.second} for pair in self.pairs):
            self.pairs = (Pair(name, first, second), *self.pairs)

    def load_pairs(self, path: Path) -> None:
        """Load the list of pairs from the file ``path``."""
        try:
            self.pairs = read_pairs(path)
        except FacePoserError as error:
            self.context.dialogs.report("The pairs cannot be loaded", str(error))

    def save_pairs(self, path: Path) -> None:
        """Save the list of pairs to the file ``path``."""
        try:
            write_pairs(path, self.pairs)
        except FacePoserError as error:
            self.context.dialogs.report("The pairs cannot be saved", str(error))
            return
        self.context.notify(f"Saved {path.name}")

    # Result

    @property
    def by_keys(self) -> KeysFeature:
        """The feature with the key poses of the method "examples"."""
        return self.context.feature(KeysFeature)

    def _transfer_by_keys(self, source: FaceModel, target: FaceModel) -> None:
        """Choose the transfer by the keys, unless they are missing or being read.

        Raises:
            FacePoserError: If the characters or the keys do not allow it.
        """
        opened = self.by_keys.opened
        if opened.error:
            raise FacePoserError(opened.error)
        keys = opened.keys
        if keys is None:
            return
        self._check_characters(keys, source, target)
        if keys.transfer is None:
            raise FacePoserError(keys.problem)
        transfer = HeadTransfer(keys.transfer, source)
        distance, remark = reach_of(keys.transfer, transfer.converted(self.context.session.coefficients[None])[0])
        if not remark:
            left_out = f"{counted(len(keys.left_out), 'key pose')} left out: see Edit." if keys.left_out else ""
            remark = " ".join(filter(None, (keys.notes, left_out)))
        self.reach = (f"The pose is {10.0 * distance:.1f} mm from the key poses.", remark)
        # The target may have been made anew since the keys were read.
        self._transfer, self.target = transfer, keys.transfer.target

    def _check_characters(self, keys: KeySet, source: FaceModel, target: FaceModel) -> None:
        """Check that the key poses are those of the open character and of the chosen target.

        Raises:
            FacePoserError: If they are those of others, or the target has no shapes.
        """
        if not keys.is_of("source", source):
            if keys.source_model().character.name == source.character.name:
                check_same_rig(keys.folder, keys.source_model(), source)
            expected, title = keys.source_model().character.title, source.character.title
            raise FacePoserError(
                f"These key poses are of {expected}, not of {title}: open {expected}, or other key poses."
            )
        if keys.folder.is_mesh:
            raise FacePoserError("The target of these key poses is a mesh without shapes: use the command transfer.")
        other = self.target_of_keys
        if other is not None:
            raise FacePoserError(f"These key poses are for {other[1]}, not for {target.character.title}.")

    def _measure(self, model: FaceModel | None, pose: Array | None) -> list[float | None]:
        """Return the length of each pair in ``pose`` of ``model``, None for pairs that cannot be measured."""
        if model is None or pose is None:
            return [None] * len(self.pairs)
        measurable = [pair for pair in self.pairs if pair.measurable(model.character)]
        if not measurable:
            return [None] * len(self.pairs)
        distances = PairPoints(model, measurable).distances(pose[None])[0].tolist()
        lengths = dict(zip(measurable, distances, strict=True))
        return [lengths.get(pair) for pair in self.pairs]

    @property
    def scenes(self) -> tuple[Scene, Scene]:
        """Scenes that draw the previews of the source and of the target."""
        if self._scenes is None:
            self._scenes = (Scene(self.context.gl), Scene(self.context.gl))
        return self._scenes

    def accept(self) -> None:
        """Open the result as a new session, after a question about unsaved changes that leaves the dialog open."""
        if self.result is None or self.target is None or self._transfer is None:
            return
        session = self.context.session
        document = transferred(session.document, session.coefficients, self._transfer, self.to, self.target)
        # The target may have been made anew since it was shown.
        versioned = document.with_version_data(self.target)
        self.context.guard_changes(lambda: self._open(versioned))

    def _open(self, document: Document) -> None:
        self.hide()

        def opening(worker: Worker) -> Session:
            session = session_for(document, None, worker)
            session.mark_unsaved()
            return session

        if self.context.show_session(opening, "The expression cannot be transferred"):
            animated = document.keyframes is not None and document.keyframes.keys
            self.context.notify(f"Opened the result as a new {'animation' if animated else 'pose'}, not saved yet")
