"""The photo with the face as it is now, written in full size in the background."""

from collections.abc import Sequence
from pathlib import Path

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.features.photo.feature import PhotoFeature
from faceposer.gui.settings import last_folder
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.gui.widgets.modal import draw_job, modal
from faceposer.gui.work_feature import WorkFeature
from faceposer.photo.photo import Photo
from faceposer.progress import Progress
from faceposer.render.images import write_png
from faceposer.session.jobs import ThreadJob, outcome
from faceposer.session.photos import check_no_photo

_WIDTH, _WRITING = 36.0, "Writing the file"


class ChangedPhotoFeature(WorkFeature):
    """The command that writes the changed photo, and the dialog with its progress.

    Attributes:
        job: The work in progress, or None. Its result is the path.
    """

    def __init__(self, context: EditorContext) -> None:
        super().__init__(context)
        self.open = False
        self.job: ThreadJob[Path] | None = None
        self._path = Path()

    @property
    def working(self) -> str:
        """What is being done in the background, as a sentence, or ""."""
        return "" if self.job is None else f"The picture '{self._path.name}' is being written."

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the entry of the File menu."""
        photos = self.context.feature(PhotoFeature)

        def possible() -> bool:
            return not self.context.busy and photos.photo is not None and not photos.put_back_problem

        return (
            Action(
                "photo-save",
                "Save changed photo...",
                "File",
                self.ask,
                (),
                possible,
                help="Write the photo in full size, with the face as it is now put back into it, as a PNG image",
            ),
        )

    def ask(self) -> None:
        """Ask for a file, and write the active photo with the present face to it."""
        context, photo = self.context, self.context.feature(PhotoFeature).photo
        if photo is None:
            return
        if not paths.is_file(Path(photo.path)):
            self._report(f"There is no photo '{photo.path}' any more; put it back.")
            return
        folder = Path(photo.path).parent
        start = folder if paths.can_enter(folder) else last_folder(context.settings)
        place = start / f"{Path(photo.path).stem}-changed.png"
        context.ask_for_file(
            FileRequest("save", "Save changed photo", "Pictures", (".png",), place, lambda path: self.save(photo, path))
        )

    def save(self, photo: Photo, path: Path) -> None:
        """Write ``photo`` with the present face to ``path``, in the background."""
        session = self.context.session
        try:
            check_no_photo(session.document, path)
        except FacePoserError as error:
            self._report(str(error))
            return
        vertices, model, identity = session.vertices, session.base_model, session.document.identity

        def work(progress: Progress) -> Path:
            # Imported late to shorten the start of the window.
            from faceposer.photo.putting_back import put_back
            from faceposer.session.putting_back import head_in_photo, skin_change

            progress.at("Reading the photo")
            head = head_in_photo(model, photo)
            progress.at("Putting the face back")
            pixels = put_back(head, vertices, skin_change(model, identity), progress)
            progress.at(_WRITING)
            write_png(path, pixels)
            return path

        self._path, self.open = path, True
        self.job = ThreadJob(work, self.context.wake, "Reading the photo")
        self.context.redraw()

    def update(self) -> None:
        """Show the progress, and say how the work ended.

        Raises:
            Exception: The error of the work, unless the user can resolve it; then a dialog shows it.
        """
        job = self.job
        if job is None or not self.ended(job):
            return
        self.job, self.open = None, False
        path, problem = outcome(job, "close other programs, or use a smaller photo.")
        if problem:
            self._report(problem)
        elif path is not None:
            self.context.notify(f"Saved {path.name}")

    def _report(self, problem: str) -> None:
        self.context.dialogs.report("The picture was not saved", problem)

    def draw_dialog(self) -> None:
        """Draw the progress, if a picture is being written."""
        job, context = self.job, self.context
        if job is None or context.dialogs.open:
            return
        with modal("##photo-save", _WIDTH) as shown:
            if shown:
                stage = "Stopping..." if job.cancelled else f"{job.stage}..."
                safe = "" if job.stage == _WRITING else " Nothing is written if you cancel."
                text = f"{stage}{safe}"
                draw_job(context.fonts, context.widget_rects, "photo-save", f"Writing {self._path.name}", job, text)

    def close(self) -> None:
        """Cancel the work; nothing is written."""
        if self.job is not None:
            self.job.cancel()

    def join(self) -> None:
        """Wait until the work has ended."""
        if self.job is not None:
            self.job.join()
