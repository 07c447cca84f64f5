"""Films of faces: the dialog, the work in the background, the keys, and the film beside the face."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from imgui_bundle import ImVec2, imgui

from faceposer.errors import FacePoserError, counted
from faceposer.files import paths
from faceposer.film.film import FILM_SUFFIXES
from faceposer.film.opening import open_film
from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.features.animation_files.feature import AnimationFilesFeature
from faceposer.gui.features.film.dialog import FilmDialog
from faceposer.gui.features.film.state import FilmState
from faceposer.gui.features.timeline.feature import TimelineFeature
from faceposer.gui.settings import last_folder
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.gui.widgets.pictures import Picture
from faceposer.gui.widgets.theme import EDGE, em, u32
from faceposer.gui.work_feature import WorkFeature
from faceposer.session.jobs import outcome
from faceposer.session.session import Session

if TYPE_CHECKING:
    from faceposer.gui.features.film.stills import Stills

# Width of the film beside the face, as a share of the view, and its distance from the corner in font sizes.
_SHARE, _MARGIN = 0.24, 0.8


@dataclass(frozen=True, eq=False)
class _Shown:
    """A film that is shown beside the face: its pictures, the frame at which the animation begins, and whose it is."""

    stills: "Stills"
    first: int
    session: Session
    length: int
    rate: float


class FilmFeature(FilmState, WorkFeature):
    """The dialog that animates the face by a film, and the film beside the face.

    Attributes:
        visible: Show the film beside the face.
    """

    def __init__(self, context: EditorContext) -> None:
        super().__init__(context)
        WorkFeature.__init__(self, context)
        self._dialog = FilmDialog(self)
        self.visible = True
        self._shown: _Shown | None = None
        self._picture = Picture()

    @property
    def working(self) -> str:
        """What is being done in the background, as a sentence, or ""."""
        return "" if self.job is None else "The face in a film is being followed."

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the entries of the menus."""
        timeline = self.context.feature(TimelineFeature)
        return (
            Action(
                "open-film",
                "Open film...",
                "Animate",
                self.ask,
                enabled=lambda: timeline.free,
                help="Animate the face by the expressions of a person in a film (MP4, MOV, WebM and others, GIF)",
            ),
            Action(
                "film-shown",
                "Show the film",
                "View",
                self.toggle,
                (),
                lambda: self._shown is not None,
                lambda: self._shown is not None and self.visible,
                help="Show the frames of the film beside the face that follows it",
            ),
        )

    def accept_files(self, dropped: tuple[str, ...]) -> bool:
        """Open a dropped film."""
        if self.context.is_modal or self.context.busy or len(dropped) != 1:
            return False
        path = Path(dropped[0])
        if path.suffix.lower() not in FILM_SUFFIXES:
            return False
        self.open_film(path)
        return True

    # The dialog

    def ask(self) -> None:
        """Ask for a film."""
        self.context.feature(TimelineFeature).stop()
        folder = last_folder(self.context.settings)
        self.context.ask_for_file(FileRequest("open", "Open film", "Films", FILM_SUFFIXES, folder, self.open_film))

    def open_film(self, path: Path) -> None:
        """Open the film ``path`` and show the dialog."""
        # Imported late to shorten the start of the window.
        from faceposer.photo.automatic import check_takes

        path = paths.absolute(paths.expand_user(path))
        try:
            check_takes(self.context.session.model, "films", "animate it by trajectories instead")
            self.film = open_film(path)
        except FacePoserError as error:
            self.context.dialogs.report("The film cannot be opened", str(error))
            return
        self.context.settings.folder = str(paths.resolved(path.parent))
        self.context.toolbox.finish()
        self.context.slider_edit.let_go()
        self.open, self.error, self.result, self.start, self.end = True, "", None, "", ""
        self.context.redraw()

    def close_dialog(self) -> None:
        """Close the dialog; its film and picture are forgotten."""
        super().close_dialog()
        self._dialog.forget()

    def update(self) -> None:
        """Show the progress of the work, and its result when it ends.

        Raises:
            Exception: The error of the work, unless the user can resolve it; then the dialog shows it.
        """
        job = self.job
        if job is None:
            return
        self.context.redraw(1)
        if not job.done:
            return
        self.job = None
        self.context.redraw()
        self.result, self.error = outcome(job, "choose a shorter part of the film.")

    def take(self, few: bool) -> None:
        """Set the keys, ``few`` of them or one at every frame, as one step of the history, and close the dialog."""
        result, stills, film = self.result, self.stills, self.film
        assert result is not None
        assert stills is not None
        assert film is not None
        keyframes = result.few if few else result.dense
        self.close_dialog()
        self.context.feature(AnimationFilesFeature).load(keyframes, "Open a film")
        session, found = self.context.session, result.found
        self._shown = _Shown(stills, found.first, session, keyframes.length, keyframes.rate)
        self.visible = True
        self.context.dismiss_guide()
        self.context.notify(f"Opened {film.path.name}: {counted(len(keyframes.keys), 'key')}")

    # The film beside the face

    def toggle(self) -> None:
        """Show or hide the film."""
        self.visible = not self.visible
        self.context.redraw()

    def session_changed(self) -> None:
        """Forget the film of another session."""
        if self._shown is not None and self._shown.session is not self.context.session:
            self._shown = None

    def draw_over(self, draw: imgui.ImDrawList) -> None:
        """Draw the frame of the film that belongs to the current frame of the timeline."""
        shown, session = self._shown, self.context.session
        if shown is None or not self.visible or session is not shown.session:
            return
        keyframes = session.animation.keyframes
        if not keyframes.keys or (keyframes.length, keyframes.rate) != (shown.length, shown.rate):
            return
        image = shown.stills.at(shown.first + session.document.frame)
        if image is None:
            return
        viewport = self.context.viewport
        (left, top), (room, _) = viewport.origin, viewport.size
        height, width = image.shape[:2]
        scale = _SHARE * max(viewport.size) / max(width, height)
        margin = em(_MARGIN)
        high = ImVec2(left + room - margin, top + margin + scale * height)
        low = ImVec2(high.x - scale * width, top + margin)
        texture = self._picture.texture(self.context.gl, image)
        draw.add_image(imgui.ImTextureRef(texture), low, high)
        draw.add_rect(low, high, u32(EDGE))

    # Dialog, and end of the program

    def draw_dialog(self) -> None:
        """Draw the dialog, if it is open."""
        if self.open and not self.context.dialogs.open:
            self._dialog.draw()

    def close(self) -> None:
        """Cancel the work and release pictures."""
        self.stop()
        self._dialog.release()
        self._picture.release()

    def join(self) -> None:
        """Wait until the cancelled work has ended."""
        if self.job is not None:
            self.job.join()
