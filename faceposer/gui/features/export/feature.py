"""Files of other programs in the window: what is exported, films that are drawn between frames, and poses opened."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.export.dialog import draw_form, draw_progress
from faceposer.gui.settings import last_folder
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.interchange.formats import FORMATS, Output, offered, write_sequence_steps, write_steps
from faceposer.interchange.meshes import foreign_library
from faceposer.render.options import OutputOptions
from faceposer.session.jobs import StepJob

if TYPE_CHECKING:
    from faceposer.model.performance import Performance

# For which frames of a film are drawn before the window's next.
_DRAW_SECONDS = 0.15
_MESHES = (".obj", ".ply")
POSES = (".obj", ".ply", ".csv", ".txt", ".json", ".glb", ".gltf")


@dataclass
class ExportForm:
    """What is to be exported and how; kept for the next time.

    Attributes:
        suffix: Of the format.
        animated: Whether the animation is wanted where there is one, and not the pose.
        width: Of pictures, in pixels.
        height: Likewise.
        turning: Whether the camera goes round while the animation plays; for a pose alone it always does.
        seconds: How long a turn takes.
        rate: Frames per second of films.
        transparent: Whether pictures have no background.
    """

    suffix: str = ".glb"
    animated: bool = True
    width: int = 640
    height: int = 640
    turning: bool = False
    seconds: float = 4.0
    rate: int = 25
    transparent: bool = False


class ExportFeature(Feature):
    """The File menu's entries for other programs' files.

    Attributes:
        form: What the dialog holds.
        open: Whether the dialog is shown.
        job: What is being written, if anything; its result is the path.
        target: That path.
        performance: Gives the animation of the window, if there is one.
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
        """Seconds for which the loop may sleep: none while a film is drawn."""
        return 0.0 if self.job is not None else super().patience

    @property
    def is_modal(self) -> bool:
        """Whether the dialog is shown, or a film is drawn."""
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
                help="Write the face as GLB, OBJ, PLY, ARKit weights, picture or film",
            ),
            Action(
                "open-pose",
                "Open pose...",
                "File",
                self.open_pose_dialog,
                (),
                free,
                separated=True,
                help="Take the pose from a mesh of this face (OBJ, PLY) or from weights (CSV, JSON, GLB)",
            ),
        )

    # Out

    def show(self) -> None:
        """Open the dialog."""
        self.context.toolbox.finish()
        self.context.slider_edit.let_go()
        if FORMATS[self.form.suffix].missing():
            self.form.suffix = ExportForm.suffix
        self.open = True
        self.context.redraw()

    def end(self) -> None:
        """Put the dialog away, or end the film, of which nothing is kept."""
        self.open = False
        self._cancel_job()
        self.context.redraw()

    def choose_file(self) -> None:
        """Put the dialog away and ask where to write."""
        context, suffix = self.context, self.form.suffix
        self.open = False
        session = context.session
        last = Path(context.settings.export_path)
        folder = last.parent if context.settings.export_path and last.parent.is_dir() else last_folder(context.settings)
        stem = session.path.stem if session.path else Path(session.document.character).stem
        name = FORMATS[suffix].name
        if self.writes_folder:
            title = f"Export as a folder of {name} files"
            request = FileRequest("new folder", title, f"{name} files", (suffix,), folder / stem, self.export)
        else:
            start, others = folder / f"{stem}{suffix}", self._others()
            request = FileRequest(
                "save",
                f"Export as {name}",
                f"{name} files",
                (suffix,),
                start,
                self.export,
                others,
                self._replaced_beside,
            )
        context.ask_for_file(request)

    @property
    def writes_folder(self) -> bool:
        """Whether the form asks for a folder with a file for each frame."""
        return FORMATS[self.form.suffix].sequence is not None and not isinstance(self._motion(), np.ndarray)

    def _others(self) -> tuple[str, ...]:
        """Return the suffixes that may be typed in place of the form's: of what can hold the same, and be written."""
        still = isinstance(self._motion(), np.ndarray)
        return offered(lambda form: form.suffix != self.form.suffix and (still or form.animated))

    def _replaced_beside(self, path: Path) -> tuple[Path, ...]:
        materials = FORMATS[path.suffix.lower()].materials and self.context.settings.materials
        return foreign_library(path) if materials else ()

    def export(self, path: Path) -> None:
        """Write the face to the file or folder ``path``, or begin to film it, as the form says.

        The suffix of a file decides its format.
        """
        context, form = self.context, self.form
        if not self.writes_folder and path.suffix.lower() in FORMATS:
            form.suffix = path.suffix.lower()
        written = FORMATS[form.suffix]
        try:
            context.session.wait()
            motion, model = self._motion(), context.session.model
            still = isinstance(motion, np.ndarray)
            options = OutputOptions(
                size=(form.width, form.height),
                turn=form.seconds if form.turning or still else 0.0,
                rate=float(form.rate) if written.holds == "film" else None,
                shading=context.shading,
                orbit=context.viewport.view,
                expression_lines=context.settings.expression_lines,
                contact=context.session.document.contact,
                transparent=form.transparent and written.transparent,
                materials=context.settings.materials,
            )
            output = Output(path, model, motion, options, context.gl)
            self.target = path
            if written.sequence is not None and not still:
                self.job = StepJob(write_sequence_steps(output, form.suffix), path)
            else:
                self.job = StepJob(write_steps(output), path)
                if not written.drawn:
                    # Soon done: no progress appears.
                    self.job.advance(math.inf)
                    self._finish()
        except FacePoserError as error:
            context.dialogs.report("The face is not exported", str(error))
        context.redraw()

    def _motion(self) -> "NDArray[np.float64] | Performance":
        """Return the pose, or the animation where it is wanted, there is one, and the format takes it."""
        performance, chosen = self.performance(), FORMATS[self.form.suffix]
        if performance is not None and self.form.animated and (chosen.animated or chosen.sequence is not None):
            return performance
        return self.context.session.coefficients

    def update(self) -> None:
        """Draw the next frames of the film, as many as the progress may wait for."""
        if self.job is not None:
            self.context.redraw(1)
            self.job.advance(time.perf_counter() + _DRAW_SECONDS)
            self._finish()

    def _finish(self) -> None:
        """Report the end of what was being written, if it has ended.

        Raises:
            Exception: What went wrong, unless the user can mend it.
        """
        job = self.job
        if job is None or not job.done:
            return
        self.job = None
        if isinstance(job.error, FacePoserError):
            self.context.dialogs.report("The face is not exported", str(job.error))
        elif job.error is not None:
            raise job.error
        elif job.result is not None:
            self._written(job.result)

    def _written(self, path: Path) -> None:
        self.context.settings.export_path = str(path.resolve())
        self.context.notify(f"Saved {path.name}")

    def _cancel_job(self) -> None:
        if self.job is not None:
            self.job.cancel()
            self.job = None

    # In

    def open_pose_dialog(self) -> None:
        """Ask for a mesh or weights and take the pose from there."""
        context = self.context
        last = Path(context.settings.export_path)
        folder = last.parent if context.settings.export_path and last.parent.is_dir() else last_folder(context.settings)
        context.ask_for_file(FileRequest("open", "Open a pose", "Poses", POSES, folder, self.open_pose))

    def open_pose(self, path: Path) -> None:
        """Make the pose in ``path`` the one that editing starts from, without constraints, as one step."""
        from faceposer.interchange.reading import read_pose

        context = self.context
        try:
            read = read_pose(path, context.session.model)
        except FacePoserError as error:
            context.dialogs.report("The pose is not opened", str(error))
            return
        context.toolbox.cancel()
        session = context.session
        with session.edit("Open a pose"):
            session.replace(replace(session.document, constraints=()))
            session.set_start(read.coefficients)
        context.notify(f"Opened {path.name}. {read.note}".strip())

    def accept_files(self, paths: tuple[str, ...]) -> bool:
        """Open a mesh that was dropped as a pose, unless the import dialog waits for one."""
        path = Path(paths[0])
        if self.is_modal or path.suffix.lower() not in _MESHES or path.is_dir():
            return False
        self.context.toolbox.finish()
        self.open_pose(path)
        return True

    # Drawing

    def draw_dialog(self) -> None:
        """Draw the form or how far the film is, unless another dialog is above."""
        if self.context.dialogs.open or self.context.file_dialogs.browsing:
            return
        if self.job is not None:
            draw_progress(self.context, self, self.job)
        elif self.open:
            draw_form(self.context, self)

    def close(self) -> None:
        """End the film that is being written."""
        self._cancel_job()
