"""Dialogs that make heads: the entry of the menus, the dialog, and dropped files."""

from collections.abc import Callable, Sequence
from pathlib import Path

from imgui_bundle import imgui

from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.features.head_making.contents import H, M
from faceposer.gui.features.head_making.dialog import HeadDialog
from faceposer.gui.features.head_making.state import HeadMaking
from faceposer.gui.work_feature import WorkFeature
from faceposer.session.jobs import outcome


class HeadMakingFeature(HeadMaking[M, H], WorkFeature):
    """A dialog that makes a character of a person; subclasses say of what, and how."""

    def __init__(self, context: EditorContext) -> None:
        super().__init__(context)
        WorkFeature.__init__(self, context)
        self.dialog = HeadDialog(self)
        self._on_forget = self.dialog.forget

    @property
    def working(self) -> str:
        """What is being done in the background, as a sentence, or ""."""
        return "" if self.job is None else f"A head is being made from {self.words.noun}s."

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the entry of the menus "File" and "Head"."""
        name, label, help_ = self.words.action

        def free() -> bool:
            return not self.context.busy

        return (Action(name, label, "File", self.show, (), free, help=help_, also="Head"),)

    def draw_around_dialogs(self, draw_dialogs: Callable[[], None]) -> bool:
        """Draw the dialog, if it is open, with file dialogs above it."""
        if self.open:
            self.dialog.draw(draw_dialogs)
        return self.open

    def take_key(self, key: str) -> bool:
        """Undo and redo moves of landmarks, reset the selected one, and show the whole picture."""
        if not self.open or self.context.dialogs.open or imgui.get_io().want_text_input:
            return False
        pages = {"landmarks": self.dialog.landmarks.zoom, "fitting": self.dialog.compared.zoom}
        actions, edit = self.context.actions, self.landmarks
        if key in actions["frame"].keys and self.page in ("landmarks", "fitting", "result"):
            pages.get(self.page, self.dialog.compared.zoom).fit()
        elif self.page != "landmarks":
            return False
        elif key in actions["undo"].keys:
            edit.undo()
        elif key in actions["redo"].keys:
            edit.redo()
        elif key in actions["delete"].keys and edit.selected:
            edit.reset((edit.selected,))
        else:
            return False
        self.context.redraw()
        return True

    def accept_files(self, dropped: tuple[str, ...]) -> bool:
        """Add dropped files; from the landmarks the way leads back to the form, where they are shown."""
        if not self.open:
            return False
        if self.page == "result":
            self.error = "Save or discard the head before you add files."
            self.context.redraw()
            return True
        if self.page == "landmarks":
            self.back()
        self.add(*map(Path, dropped))
        return True

    def update(self) -> None:
        """Show the progress of the work, and its result when it ends.

        Raises:
            Exception: The error of the work, unless the user can resolve it; then the dialog shows it.
        """
        job = self.job
        if job is None or not self.ended(job):
            return
        finding, fitting, self.finding, self.fitting = self.finding, self.fitting, None, None
        remedy = "use fewer or smaller files."
        if finding is not None:
            found, self.error = outcome(finding, remedy)
            if found is not None:
                self.take_found(found)
        elif fitting is not None:
            self.result, self.error = outcome(fitting, remedy)

    def close(self) -> None:
        """Cancel the work and release pictures."""
        self.stop()
        self.dialog.release()
