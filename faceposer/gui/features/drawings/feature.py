"""Drawings in SVG that pose the face, opened from the menu or dropped onto the window."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.settings import last_folder
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.gui.widgets.modal import draw_job, modal
from faceposer.progress import Progress
from faceposer.session.drawings import SUFFIX, add_sketches, read_drawing, summary
from faceposer.session.jobs import ThreadJob, outcome
from faceposer.session.session import Session
from faceposer.solve.constraints.sketch import SketchConstraint

if TYPE_CHECKING:
    from faceposer.sketch.drawing import RecognisedDrawing

# Time after which the progress is shown.
_DIALOG_AFTER = 0.3


@dataclass(frozen=True, eq=False)
class _Opening:
    path: Path
    session: Session
    job: "ThreadJob[tuple[RecognisedDrawing, tuple[SketchConstraint, ...]]]"


class DrawingsFeature(Feature):
    """The entry "Open drawing...", and drawings that are dropped onto the window."""

    def __init__(self, context: EditorContext) -> None:
        super().__init__(context)
        self._opening: _Opening | None = None

    @property
    def is_modal(self) -> bool:
        """True while the progress is shown."""
        return self._opening is not None and self._opening.job.seconds > _DIALOG_AFTER

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the entry of the menu "File"."""
        return [
            Action(
                "open-drawing",
                "Open drawing...",
                "File",
                self.ask,
                enabled=lambda: self._free,
                help="Pose the face by a drawing in SVG, which shows the face as the present view does",
            )
        ]

    @property
    def _free(self) -> bool:
        return self._opening is None and not self.context.busy and not self.context.session.editing

    def ask(self) -> None:
        """Ask for a drawing and open it."""
        start = last_folder(self.context.settings)
        self.context.ask_for_file(FileRequest("open", "Open drawing", "Drawings", (SUFFIX,), start, self.open))

    def accept_files(self, dropped: tuple[str, ...]) -> bool:
        """Open the dropped file if it is a drawing."""
        if not all(Path(path).suffix.lower() == SUFFIX for path in dropped) or self.context.is_modal or not self._free:
            return False
        if len(dropped) > 1:
            self.context.notify("Drop one drawing at a time")
            return True
        self.open(Path(dropped[0]))
        return True

    def open(self, path: Path) -> None:
        """Recognise the drawing ``path`` in the background; its sketches are then one step of the history."""
        context = self.context
        if not self._free:
            return
        context.settings.folder = str(paths.resolved(path.parent))
        context.toolbox.cancel()
        model, camera = context.session.model, context.viewport.camera

        def work(progress: Progress) -> "tuple[RecognisedDrawing, tuple[SketchConstraint, ...]]":
            return read_drawing(model, path, camera, progress=progress)

        self._opening = _Opening(path, context.session, ThreadJob(work, context.wake, "Reading the drawing"))
        context.redraw()

    def update(self) -> None:
        """Add the sketches once the drawing is recognised.

        Raises:
            Exception: The error of the recognition, unless the user can resolve it; then a dialog reports it.
        """
        opening = self._opening
        if opening is None:
            return
        self.context.redraw(1)
        if not opening.job.done or self.context.busy:
            return
        self._opening = None
        self.context.redraw()
        result, error = outcome(opening.job, "use a smaller drawing.")
        if error:
            self.context.dialogs.report("The drawing cannot be used", error)
        elif result is not None and opening.session is self.context.session:
            found, sketches = result
            try:
                add_sketches(opening.session, sketches, opening.path.name)
            except FacePoserError as full:
                self.context.dialogs.report("The drawing cannot be used", str(full))
                return
            self.context.notify(f"{opening.path.name}: {summary(found)}")

    def draw_dialog(self) -> None:
        """Draw the progress, unless another dialog is open above it."""
        opening, context = self._opening, self.context
        if opening is None or not self.is_modal or context.dialogs.open:
            return
        with modal("##drawing", 26.0) as shown:
            if shown:
                said = "Stopping..." if opening.job.cancelled else f"{opening.job.stage}..."
                draw_job(context.fonts, context.widget_rects, "drawing", "Opening the drawing", opening.job, said)

    def close(self) -> None:
        """Cancel the recognition."""
        if self._opening is not None:
            self._opening.job.cancel()
            self._opening.job.join()
            self._opening = None

    def join(self) -> None:
        """Wait for the recognition."""
        if self._opening is not None:
            self._opening.job.join()
