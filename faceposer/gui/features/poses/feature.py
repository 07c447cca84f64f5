"""The tab "Poses" in the window, and the menu "Pose"."""

from collections.abc import Sequence

from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.poses.commands import PoseCommands
from faceposer.gui.features.poses.panel import PosesPanel


class PosesFeature(PoseCommands, Feature):
    """The tab "Poses"."""

    tab = ("Poses", "Expressions, visemes and your own poses")

    def __init__(self, context: EditorContext) -> None:
        super().__init__(context)
        Feature.__init__(self, context)
        self._panel = PosesPanel(self)

    # Called by the window

    @property
    def patience(self) -> float:
        """Seconds for which the loop may sleep."""
        return 0.0 if self.portraits.waiting and not self.context.toolbox.active else super().patience

    @property
    def is_modal(self) -> bool:
        """True while the dialog for a name is open."""
        return self._name_dialog.open

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the entries of the menu "Pose"."""

        def free() -> bool:
            return not self.context.busy

        return (
            Action(
                "pose-save", "Save pose...", "Pose", self.ask_to_save, (), free, help="Save this pose to the library"
            ),
            Action(
                "pose-mirror",
                "Mirror left to right",
                "Pose",
                lambda: self.mirror("left"),
                (),
                free,
                separated=True,
                help="Mirror the left side of the face to the right. Clears the constraints, as Accept does",
            ),
            Action(
                "pose-mirror-right",
                "Mirror right to left",
                "Pose",
                lambda: self.mirror("right"),
                (),
                free,
                help="Mirror the right side of the face to the left. Clears the constraints, as Accept does",
            ),
            Action(
                "pose-flip",
                "Flip",
                "Pose",
                self.flip,
                (),
                free,
                help="Swap the left and right side of the face. Clears the constraints, as Accept does",
            ),
            Action(
                "pose-folder",
                "Choose folder of poses...",
                "Pose",
                self.ask_for_folder,
                (),
                free,
                separated=True,
                help="Choose the folder of your pose library",
            ),
        )

    def session_changed(self) -> None:
        """Discard the thumbnails, which show another face."""
        self._applied = None
        self.portraits.forget()

    def model_changed(self) -> None:
        """Discard the thumbnails, which show another head."""
        self.portraits.forget()

    def update(self) -> None:
        """Draw the next thumbnail, unless the user is dragging."""
        if not self.context.toolbox.active:
            self.portraits.draw_next()

    def draw_tab(self) -> None:
        """Draw the tab."""
        self._panel.draw()

    def draw_dialog(self) -> None:
        """Draw the dialog for a name."""
        self._name_dialog.draw()

    def close(self) -> None:
        """Release the thumbnails."""
        self.portraits.release()
