"""Films of faces: the dialog, the work in the background, the keys, and the film beside the face."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from imgui_bundle import ImVec2, imgui

from faceposer.animation.keyframes import FilmSource
from faceposer.errors import FacePoserError, counted
from faceposer.files import paths
from faceposer.film.film import FILM_SUFFIXES, Span
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
from faceposer.progress import Progress
from faceposer.session.jobs import ThreadJob, outcome

if TYPE_CHECKING:
    from faceposer.gui.features.film.stills import Stills

# Longer side in pixels at which frames are read to be shown.
_SIDE = 720
# Width of the film beside the face, as a share of the view, and its distance from the corner in font sizes.
_SHARE, _MARGIN = 0.24, 0.8


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
        # Pictures of the film of the animation, and what they were read of.
        self._pictures: Stills | None = None
        self._read_of: FilmSource | None = None
        # The film that could not be read when it was looked for last.
        self._failed: FilmSource | None = None
        self._reading: ThreadJob[None] | None = None
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
                lambda: self._source is not None,
                lambda: self._source is not None and self.visible and self._source != self._failed,
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
        self._keep_pictures()
        job = self.job
        if job is None or not self.ended(job):
            return
        self.job = None
        self.result, self.error = outcome(job, "choose a shorter part of the film.")

    def take(self, few: bool) -> None:
        """Set the keys, ``few`` of them or one at every frame, as one step of the history, and close the dialog."""
        result, stills, film = self.result, self.stills, self.film
        assert result is not None
        assert stills is not None
        assert film is not None
        source = FilmSource(str(film.path), result.found.first, film.rate)
        keyframes = replace(result.few if few else result.dense, film=source)
        self.close_dialog()
        self._stop_reading()
        self._pictures, self._read_of = stills, source
        self.context.feature(AnimationFilesFeature).load(keyframes, "Open a film")
        self.visible = True
        self.context.dismiss_guide()
        self.context.notify(f"Opened {film.path.name}: {counted(len(keyframes.keys), 'key')}")

    # The film beside the face

    def toggle(self) -> None:
        """Show or hide the film; one that could not be read is looked for again."""
        if self._source is not None and self._source == self._failed:
            self.visible, self._failed, self._read_of = True, None, None
        else:
            self.visible = not self.visible
        self.context.redraw()

    @property
    def _source(self) -> FilmSource | None:
        """The film that the animation follows, or None."""
        keyframes = self.context.session.animation.keyframes
        return keyframes.film if keyframes.keys else None

    def _keep_pictures(self) -> None:
        """Read the pictures of the film of the animation in the background, unless they are known."""
        source, job = self._source, self._reading
        if job is not None and job.done:
            self._reading = None
            self.context.redraw()
            if isinstance(job.error, FacePoserError):
                self._failed = self._read_of
                self.context.notify(f"The film is not shown beside the face. {job.error}")
            elif job.error is not None:
                raise job.error
        if self._reading is not None:
            self.context.redraw(1)
        if source is None or not self.visible or source == self._read_of:
            return
        self._stop_reading()
        # Imported late to shorten the start of the window.
        from faceposer.gui.features.film.stills import Stills

        self._pictures, self._read_of = Stills(), source
        length = self.context.session.animation.keyframes.length / self.context.session.animation.keyframes.rate
        work = partial(_read, source, length, self._pictures)
        self._reading = ThreadJob(work, self.context.wake, "Reading the film")

    def _stop_reading(self) -> None:
        if self._reading is not None:
            self._reading.cancel()
            self._reading = None

    def draw_over(self, draw: imgui.ImDrawList) -> None:
        """Draw the frame of the film that belongs to the current frame of the timeline."""
        source, session = self._source, self.context.session
        if source is None or not self.visible or self._pictures is None or source != self._read_of:
            return
        image = self._pictures.at(source.number(session.document.frame, session.animation.keyframes.rate))
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
        if self._reading is not None:
            self._reading.cancel()
        self._dialog.release()
        self._picture.release()

    def join(self) -> None:
        """Wait until the cancelled work has ended."""
        if self.job is not None:
            self.job.join()
        if self._reading is not None:
            self._reading.join()


def _read(source: FilmSource, seconds: float, pictures: "Stills", progress: Progress) -> None:
    """Read the ``pictures`` of so many ``seconds`` of a film."""
    film = open_film(Path(source.path), source.rate)
    begin = source.first / source.rate
    for frame in film.frames(Span(begin, begin + seconds), _SIDE):
        progress.at("Reading the film", min((frame.number - source.first) / (seconds * source.rate), 1.0))
        pictures.watch(frame, None)
