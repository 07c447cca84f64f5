"""Transfer of the pose to another character: the entry of the menu, and the dialog."""

from faceposer.errors import FacePoserError
from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.transfer.dialog import TransferDialog
from faceposer.gui.features.transfer.state import TransferState
from faceposer.session.opening import load_model
from faceposer.transfer.transfer import make_transfer


class TransferFeature(TransferState, Feature):
    """The dialog that transfers expressions."""

    def __init__(self, context: EditorContext) -> None:
        super().__init__(context)
        Feature.__init__(self, context)
        self._dialog = TransferDialog(self)

    @property
    def is_modal(self) -> bool:
        """True while the dialog is shown."""
        return self.open

    def actions(self) -> list[Action | Submenu]:
        """Return the entry of the Edit menu."""
        return [
            Action(
                "transfer",
                "Transfer expression to...",
                "Edit",
                self.show,
                enabled=lambda: not self.context.busy,
                separated=True,
                help="Transfer this pose to another character, independent of its mesh",
            )
        ]

    def session_changed(self) -> None:
        """Discard the result, which belongs to another session."""
        self._last_input = None

    def model_changed(self) -> None:
        """Discard the result, which belongs to another head."""
        self._last_input = None

    def draw_dialog(self) -> None:
        """Draw the dialog, unless another dialog is open above it."""
        if self.open and not (self.context.dialogs.open or self.context.file_dialogs.open):
            self.update()
            self._dialog.draw()

    def update(self) -> None:
        """Transfer the pose if any input has changed since the last call; while the dialog is closed, release it."""
        if not self.open:
            self.close()
            return
        session, opened = self.context.session, self.by_keys.opened
        if self.method == "examples":
            opened.read_changes()
        self._follow_keys()
        keys = (opened.keys, opened.error, opened.reading) if self.method == "examples" else ()
        inputs = (self.to, self.method, self.pairs, keys, session.revision, id(session))
        if inputs == self._last_input:
            return
        self._last_input = inputs
        self.error, self.reach, self.result, self._transfer = "", ("", ""), None, None
        source, pose = session.model, session.coefficients
        try:
            self.target = load_model(self.to)
            if self.method == "examples":
                self._transfer_by_keys(source, self.target)
            else:
                self._transfer = make_transfer(source, self.target, self.method, self.pairs)
            self.result = None if self._transfer is None else self._transfer.pose(pose)
        except FacePoserError as error:
            self.error = str(error)
        if self.method != "examples":
            self.lengths = (self._measure(source, pose), self._measure(self.target, self.result))
        self.context.redraw()

    def close(self) -> None:
        """Release the scenes."""
        for scene in self._scenes or ():
            scene.release()
        self._scenes = None
