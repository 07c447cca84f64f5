"""The photo with the face as it is now, in the view: computed in the background after each change."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import moderngl
import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.gui.context import EditorContext
from faceposer.gui.settings import last_folder
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.photo.photo import Photo
from faceposer.progress import Progress
from faceposer.render.images import write_png
from faceposer.render.offscreen import photo_texture
from faceposer.session.jobs import ThreadJob
from faceposer.session.photos import check_no_photo
from faceposer.session.session import Session

if TYPE_CHECKING:
    from faceposer.photo.head_in_photo import HeadInPhoto

# Longer side of the photo in the view, and that of the grid on which changes are computed there.
_LARGEST, _GRID = 1400, 500

Pixels = NDArray[np.uint8]


class PuttingBack:
    """The photo with the face as it is now.

    Attributes:
        on: True if it is shown in place of the photo and the face.
    """

    def __init__(self, context: EditorContext) -> None:
        """Show it in ``context``."""
        self.on = False
        self._context = context
        self._job: ThreadJob[Pixels] | None = None
        self._saving: tuple[ThreadJob[None], Path] | None = None
        self._asked: object = None
        self._shown: object = None
        self._texture: moderngl.Texture | None = None
        self._head: tuple[object, HeadInPhoto] | None = None

    def possible(self, photo: Photo) -> bool:
        """Return True if it is known how ``photo`` shows the face."""
        return photo.expression is not None and photo.camera is not None

    def toggle(self) -> None:
        """Show it, or photo and face again."""
        self.on = not self.on
        self._context.redraw()

    def picture(self, photo: Photo) -> moderngl.Texture | None:
        """Return the texture of ``photo`` with the present face, or None before it is known, and during gestures."""
        self._take_result()
        context, session = self._context, self._context.session
        if not self.on or not self.possible(photo):
            return None
        if context.toolbox.active or session.editing or session.solving or session.preview is not None:
            return None
        state = (id(session), session.revision, photo)
        if self._shown == state:
            return self._texture
        if self._job is None:
            self._asked = state
            self._job = ThreadJob(self._work(session, photo), context.wake)
        return None

    def _work(self, session: Session, photo: Photo) -> Callable[[Progress], Pixels]:
        """Return the work for the present state of ``session``."""
        vertices, model, identity = session.vertices, session.base_model, session.document.identity
        key = (photo.path, photo.camera, photo.expression, id(model))

        def work(progress: Progress) -> Pixels:
            # Imported late to shorten the start of the window.
            from faceposer.photo.putting_back import put_back
            from faceposer.session.putting_back import head_in_photo, skin_change

            if self._head is None or self._head[0] != key:
                self._head = (key, head_in_photo(model, photo, _LARGEST, _GRID))
            return put_back(self._head[1], vertices, skin_change(model, identity), progress)

        return work

    def _take_result(self) -> None:
        """Upload the picture once it is computed.

        Raises:
            Exception: The error of the work, unless the user can resolve it; then a dialog shows it.
        """
        self._take_saved()
        job = self._job
        if job is None or not job.done:
            return
        self._job = None
        if isinstance(job.error, FacePoserError):
            self.on = False
            self._context.dialogs.report("The face cannot be put back into the photo", str(job.error))
        elif job.error is not None:
            raise job.error
        elif job.result is not None:
            self._release_texture()
            self._texture, self._shown = photo_texture(self._context.gl, job.result), self._asked
            self._context.redraw()

    def ask_for_file(self, photo: Photo) -> None:
        """Ask for a file, and write the photo with the present face to it."""
        folder = Path(photo.path).parent
        start = folder if paths.can_enter(folder) else last_folder(self._context.settings)
        place = start / f"{Path(photo.path).stem}-changed.png"

        def save(path: Path) -> None:
            session = self._context.session
            vertices, model, identity = session.vertices, session.base_model, session.document.identity
            try:
                check_no_photo(session.document, path)
            except FacePoserError as error:
                self._context.dialogs.report("The picture was not saved", str(error))
                return

            def work(progress: Progress) -> None:
                from faceposer.photo.putting_back import put_back
                from faceposer.session.putting_back import head_in_photo, skin_change

                head = head_in_photo(model, photo)
                write_png(path, put_back(head, vertices, skin_change(model, identity), progress))

            self._saving = (ThreadJob(work, self._context.wake), path)
            self._context.notify(f"Writing {path.name}...")

        self._context.ask_for_file(FileRequest("save", "Save picture", "Pictures", (".png",), place, save))

    def _take_saved(self) -> None:
        if self._saving is None or not self._saving[0].done:
            return
        (job, path), self._saving = self._saving, None
        if isinstance(job.error, FacePoserError):
            self._context.dialogs.report("The picture was not saved", str(job.error))
        elif job.error is not None:
            raise job.error
        else:
            self._context.notify(f"{path.name} written")

    def forget(self) -> None:
        """Forget the picture, such as for another session."""
        self._release_texture()
        self._shown = self._asked = self._head = None

    def _release_texture(self) -> None:
        if self._texture is not None:
            self._texture.release()
            self._texture = None

    def join(self) -> None:
        """Wait for the work."""
        for job in (self._job, self._saving and self._saving[0]):
            if job is not None:
                job.join()
