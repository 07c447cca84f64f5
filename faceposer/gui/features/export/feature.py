"""Export of meshes, weights, images and videos, and import of poses from files of other programs."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.export.dialog import draw_form, draw_progress
from faceposer.gui.features.export.form import ExportForm
from faceposer.gui.settings import last_folder
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.interchange.formats import FORMATS, Output, offered, write_sequence_steps, write_steps
from faceposer.interchange.meshes import foreign_library
from faceposer.render.options import OutputOptions
from faceposer.session.jobs import StepJob, outcome

if TYPE_CHECKING:
    from faceposer.model.performance import Performance

# Time spent on an export before the window draws its next frame.
_DRAW_SECONDS = 0.15
_MESHES = (".obj", ".ply")
POSES = (".obj", ".ply", ".csv", ".txt", ".json", ".glb", ".gltf")


class ExportFeature(Feature):
    """Export dialog, and the command that opens poses.

    Attributes:
        form: Choices of the dialog.
        open: True while the dialog is shown.
        job: The export in progress, or None. Its result is the path.
        target: Path that the export writes.
        performance: Callable that returns the animation of the session, or None.
    """

    def __init__(self, context: EditorContext) -> None:
        super().__init__(context)
        self.form = ExportForm()
        self.open = False
        self.job: StepJob[Path] | None = None
        self.target = Path()
        self.performance: Callable[[], Performance | None] = lambda: context.session.animation.performance

    @property
    def patience(self) -> float:
        """Seconds for which the loop may sleep: none while an export is in progress."""
        return 0.0 if self.job is not None else super().patience

    @property
    def is_modal(self) -> bool:
        """True while the dialog is shown or an export is in progress."""
        return self.open or self.job is not None

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the entries of the File menu."""

        def free() -> bool:
            return not self.context.busy and not self.is_modal

        return (
            Action(
                "export-other",
                "Export as...",
                "File",
                self.show,
                (),
                free,
                help="Export the face as a mesh (GLB, OBJ, PLY), ARKit weights, an image or a video",
            ),
            Action(
                "open-pose",
                "Open pose...",
                "File",
                self.open_pose_dialog,
                (),
                free,
                separated=True,
                help="Read a pose from a mesh of this face (OBJ, PLY) or from weights (CSV, JSON, GLB)",
            ),
        )

    # Export

    def show(self) -> None:
        """Open the dialog."""
        self.context.toolbox.finish()
        self.context.slider_edit.let_go()
        if FORMATS[self.form.suffix].missing():
            self.form.suffix = ExportForm.suffix
        self.open = True
        self.context.redraw()

    def close_dialog(self) -> None:
        """Close the dialog, or cancel the export; nothing is written."""
        self.open = False
        self._cancel_job()
        self.context.redraw()

    def choose_file(self) -> None:
        """Close the dialog and ask for the file to write."""
        context, suffix = self.context, self.form.suffix
        self.open = False
        session = context.session
        folder = self._last_folder()
        stem = session.path.stem if session.path else Path(session.document.character).stem
        name = FORMATS[suffix].name
        if self.writes_folder:
            title = f"Export as folder of {name} files"
            request = FileRequest("new folder", title, f"{name} files", (suffix,), folder / stem, self.export)
        else:
            start, others = folder / f"{stem}{suffix}", self._alternative_suffixes()
            request = FileRequest(
                "save",
                f"Export as {name}",
                f"{name} files",
                (suffix,),
                start,
                self.export,
                others,
                self._material_files,
            )
        context.ask_for_file(request)

    def _last_folder(self) -> Path:
        """Return the folder of the last export, or else that of the last session."""
        settings = self.context.settings
        last = Path(settings.export_path)
        return last.parent if settings.export_path and paths.can_enter(last.parent) else last_folder(settings)

    @property
    def writes_folder(self) -> bool:
        """True if the export is a folder with one file per frame."""
        return FORMATS[self.form.suffix].sequence is not None and not isinstance(self._motion(), np.ndarray)

    def _alternative_suffixes(self) -> tuple[str, ...]:
        """Return the suffixes of other formats that can hold the same content; the user may type any of them."""
        still = isinstance(self._motion(), np.ndarray)
        return offered(lambda form: form.suffix != self.form.suffix and (still or form.animated))

    def _material_files(self, path: Path) -> tuple[Path, ...]:
        """Return existing material files of another program that an export to ``path`` would replace."""
        materials = FORMATS[path.suffix.lower()].materials and self.context.settings.materials
        return foreign_library(path) if materials else ()

    def export(self, path: Path) -> None:
        """Export the face to the file or folder ``path`` with the options of the form.

        The suffix of a file selects its format.
        """
        context, form = self.context, self.form
        if not self.writes_folder and path.suffix.lower() in FORMATS:
            form.suffix = path.suffix.lower()
        chosen = FORMATS[form.suffix]
        try:
            context.session.wait()
            motion, model = self._motion(), context.session.model
            still = isinstance(motion, np.ndarray)
            options = OutputOptions(
                size=(form.width, form.height),
                turn=form.seconds if form.turning or still else 0.0,
                rate=float(form.rate) if form.rate is not None and chosen.holds == "film" else None,
                shading=context.shading,
                orbit=context.viewport.view,
                expression_lines=context.settings.expression_lines,
                contact=context.session.document.contact,
                transparent=form.transparent and chosen.transparent,
                materials=context.settings.materials,
            )
            output = Output(path, model, motion, options, context.gl)
            self.target = path
            if chosen.sequence is not None and not still:
                self.job = StepJob(write_sequence_steps(output, form.suffix), path)
            else:
                self.job = StepJob(write_steps(output), path)
                if not chosen.drawn:
                    # Fast enough to complete at once, without a progress dialog.
                    self.job.advance(math.inf)
                    self._finish()
        except FacePoserError as error:
            context.dialogs.report("The export failed", str(error))
        context.redraw()

    def _motion(self) -> "NDArray[np.float64] | Performance":
        """Return the animation if it exists, is chosen, and the format supports it; otherwise the pose."""
        performance, chosen = self.performance(), FORMATS[self.form.suffix]
        if performance is not None and self.form.animated and (chosen.animated or chosen.sequence is not None):
            return performance
        return self.context.session.coefficients

    def update(self) -> None:
        """Advance the export in progress for a moment."""
        if self.job is not None:
            self.context.redraw(1)
            self.job.advance(time.perf_counter() + _DRAW_SECONDS)
            self._finish()

    def _finish(self) -> None:
        """Report the result of the export, if it has ended.

        Raises:
            Exception: The error of the export, unless the user can resolve it; then a dialog reports it.
        """
        job = self.job
        if job is None or not job.done:
            return
        self.job = None
        path, error = outcome(job, "choose a smaller image or a lower rate.")
        if error:
            self.context.dialogs.report("The export failed", error)
        elif path is not None:
            self._report_written(path)

    def _report_written(self, path: Path) -> None:
        self.context.settings.export_path = str(paths.resolved(path))
        self.context.notify(f"Saved {path.name}")

    def _cancel_job(self) -> None:
        if self.job is not None:
            self.job.cancel()
            self.job = None

    # Import

    def open_pose_dialog(self) -> None:
        """Ask for a mesh or a file of weights and read the pose from it."""
        context = self.context
        context.ask_for_file(FileRequest("open", "Open pose", "Poses", POSES, self._last_folder(), self.open_pose))

    def open_pose(self, path: Path) -> None:
        """Start from the pose in ``path``, without constraints, as one step of the history."""
        from faceposer.interchange.reading import read_pose

        context = self.context
        try:
            read = read_pose(path, context.session.model)
        except FacePoserError as error:
            context.dialogs.report("The pose cannot be opened", str(error))
            return
        context.toolbox.cancel()
        session = context.session
        with session.edit("Open a pose"):
            session.replace(replace(session.document, constraints=()))
            session.set_start(read.coefficients)
        all_frames = " Animate > Open animation reads all frames." if read.frames > 1 else ""
        context.notify(f"Opened {path.name}. {read.note}".strip() + all_frames)

    def accept_files(self, dropped: tuple[str, ...]) -> bool:
        """Open a dropped mesh as a pose, unless a dialog is open."""
        path = Path(dropped[0])
        if self.is_modal or path.suffix.lower() not in _MESHES or paths.is_dir(path):
            return False
        self.context.toolbox.finish()
        self.open_pose(path)
        return True

    # Drawing

    def draw_dialog(self) -> None:
        """Draw the form or the progress, unless another dialog is open above it."""
        if self.context.dialogs.open or self.context.file_dialogs.browsing:
            return
        if self.job is not None:
            draw_progress(self.context, self.target.name, self.job)
        elif self.open:
            animated = self.performance() is not None
            draw_form(self.context, self.form, animated, self.choose_file, self.close_dialog)

    def close(self) -> None:
        """Cancel the export in progress."""
        self._cancel_job()
