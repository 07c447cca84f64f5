"""Files of other programs in the window: what is exported, films that are drawn between frames, and poses opened."""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.gui.actions import Action, Submenu
from faceposer.gui.feature import Feature
from faceposer.gui.features.export.dialog import draw_form, draw_progress
from faceposer.gui.settings import last_folder
from faceposer.gui.widgets.file_dialogs import FileRequest
from faceposer.interchange.formats import FORMATS, Output, write_sequence_steps, write_steps
from faceposer.render.options import OutputOptions

if TYPE_CHECKING:
    from faceposer.gui.app import App
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
    """

    suffix: str = ".glb"
    animated: bool = True
    width: int = 640
    height: int = 640
    turning: bool = False
    seconds: float = 4.0
    rate: int = 25


@dataclass
class Filming:
    """A film or a sequence of meshes that is being written.

    Attributes:
        path: The file, or the folder of a sequence of meshes.
        steps: Draws or writes a frame each time, and gives the share that is done.
        share: How far it is, 0 to 1.
    """

    path: Path
    steps: Iterator[float]
    share: float = 0.0


class Exchange(Feature):
    """The File menu's entries for other programs' files.

    Attributes:
        form: What the dialog holds.
        open: Whether the dialog is shown.
        filming: The film that is being written, if any.
        performance: Gives the animation of the window, if there is one.
    """

    def __init__(self, app: "App") -> None:
        super().__init__(app)
        self.form = ExportForm()
        self.open = False
        self.filming: Filming | None = None
        self.performance: Callable[[], Performance | None] = lambda: None

    @property
    def patience(self) -> float:
        """Seconds for which the loop may sleep: none while a film is drawn."""
        return 0.0 if self.filming is not None else super().patience

    @property
    def covers(self) -> bool:
        """Whether the dialog is shown, or a film is drawn."""
        return self.open or self.filming is not None

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the entries of the File menu."""

        def free() -> bool:
            return not self.app.busy and not self.covers

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
        self.app.toolbox.finish()
        self.app.slider_edit.let_go()
        self.open = True
        self.app.redraw()

    def cancel(self) -> None:
        """Put the dialog away, or end the film, of which nothing is kept."""
        self.open = False
        self._stop_filming()
        self.app.redraw()

    def choose_file(self) -> None:
        """Put the dialog away and ask where to write."""
        app, suffix = self.app, self.form.suffix
        self.open = False
        session = app.session
        last = Path(app.settings.export_path)
        folder = last.parent if app.settings.export_path and last.parent.is_dir() else last_folder(app.settings)
        stem = session.path.stem if session.path else Path(session.document.subject).stem
        title = f"Export as {suffix[1:].upper()}"
        app.dialogs_ask(FileRequest("save", title, title[10:], (suffix,), folder / f"{stem}{suffix}", self.export))

    def export(self, path: Path) -> None:
        """Write the face, or begin to film it, as the form says."""
        app, form = self.app, self.form
        written = FORMATS[form.suffix]
        path = path if path.suffix.lower() == form.suffix else path.with_name(path.name + form.suffix)
        try:
            app.session.wait()
            motion, model = self._motion(), app.session.model
            still = isinstance(motion, np.ndarray)
            options = OutputOptions(
                size=(form.width, form.height),
                turn=form.seconds if form.turning or still else 0.0,
                rate=float(form.rate) if written.holds == "film" else None,
                shading=app.shading,
                orbit=app.viewport.view,
                expression_lines=app.settings.expression_lines,
                contact=app.session.document.contact,
            )
            if written.sequence is not None and not still:
                output = Output(path.with_suffix(""), model, motion, options, app.window.ctx)
                self.filming = Filming(output.path, write_sequence_steps(output, form.suffix))
            else:
                output = Output(path, model, motion, options, app.window.ctx)
                self.filming = Filming(path, write_steps(output))
                if not written.drawn:
                    # Soon done: no progress appears.
                    self._write_on(math.inf)
        except FacePoserError as error:
            app.dialogs.report("The face is not exported", str(error))
        app.redraw()

    def _motion(self) -> "NDArray[np.float64] | Performance":
        """Return the pose, or the animation where it is wanted, there is one, and the format takes it."""
        performance, chosen = self.performance(), FORMATS[self.form.suffix]
        if performance is not None and self.form.animated and (chosen.animated or chosen.sequence is not None):
            return performance
        return self.app.session.coefficients

    def follow(self) -> None:
        """Draw the next frames of the film, as many as the progress may wait for."""
        if self.filming is not None:
            self.app.redraw(1)
            self._write_on(time.perf_counter() + _DRAW_SECONDS)

    def _write_on(self, until: float) -> None:
        """Go on with what is being written until it is done or the clock says ``until``."""
        filming = self.filming
        assert filming is not None
        try:
            filming.share = next(filming.steps)
            while time.perf_counter() < until:
                filming.share = next(filming.steps)
        except StopIteration:
            self.filming = None
            self._written(filming.path)
        except FacePoserError as error:
            self.filming = None
            self.app.dialogs.report("The face is not exported", str(error))
        except BaseException:
            self.filming = None
            raise

    def _written(self, path: Path) -> None:
        self.app.settings.export_path = str(path.resolve())
        self.app.notify(f"Saved {path.name}")

    def _stop_filming(self) -> None:
        if self.filming is not None:
            # Closing a generator lets it clear away what it has begun.
            self.filming.steps.close()  # type: ignore[attr-defined]
            self.filming = None

    # In

    def open_pose_dialog(self) -> None:
        """Ask for a mesh or weights and take the pose from there."""
        app = self.app
        last = Path(app.settings.export_path)
        folder = last.parent if app.settings.export_path and last.parent.is_dir() else last_folder(app.settings)
        app.dialogs_ask(FileRequest("open", "Open a pose", "Poses", POSES, folder, self.open_pose))

    def open_pose(self, path: Path) -> None:
        """Make the pose in ``path`` the one that editing starts from, without constraints, as one step."""
        from faceposer.interchange.reading import read_pose

        app = self.app
        try:
            read = read_pose(path, app.session.model)
        except FacePoserError as error:
            app.dialogs.report("The pose is not opened", str(error))
            return
        app.toolbox.cancel()
        session = app.session
        with session.edit("Open a pose"):
            session.replace(replace(session.document, constraints=()))
            session.set_start(read.coefficients)
        app.notify(f"Opened {path.name}. {read.note}".strip())

    def drop(self, paths: tuple[str, ...]) -> bool:
        """Open a mesh that was dropped as a pose, unless the import dialog waits for one."""
        path = Path(paths[0])
        if self.covers or self.app.importing.open or path.suffix.lower() not in _MESHES or path.is_dir():
            return False
        self.app.toolbox.finish()
        self.open_pose(path)
        return True

    # Drawing

    def draw_dialog(self) -> None:
        """Draw the form or how far the film is, unless another dialog is above."""
        if self.app.dialogs.open or self.app.file_dialogs.browsing:
            return
        if self.filming is not None:
            draw_progress(self.app, self)
        elif self.open:
            draw_form(self.app, self)

    def close(self) -> None:
        """End the film that is being written."""
        self._stop_filming()
