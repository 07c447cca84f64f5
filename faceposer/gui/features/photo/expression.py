"""The expression of a photo on the open character, found in the background, without pins."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from faceposer.errors import FacePoserError
from faceposer.gui.context import EditorContext
from faceposer.photo.photo import Photo
from faceposer.progress import Progress
from faceposer.session.jobs import ThreadJob
from faceposer.session.session import Session

if TYPE_CHECKING:
    from faceposer.photo.automatic import PhotoExpression


class TakeExpression:
    """Finds the face in a photo and poses the character after it, as one step of the history."""

    def __init__(self, context: EditorContext, done: Callable[[], None]) -> None:
        """Pose in ``context``; ``done`` is called after the pose has changed."""
        self._context, self._done = context, done
        self._job: ThreadJob[tuple[PhotoExpression, str]] | None = None
        self._session: Session | None = None
        self._photo: Photo | None = None

    @property
    def running(self) -> bool:
        """True while a face is being found."""
        return self._job is not None

    @property
    def job(self) -> "ThreadJob[tuple[PhotoExpression, str]] | None":
        """The work in progress that is wanted, or None."""
        return None if self._job is None or self._job.cancelled else self._job

    def cancel(self) -> bool:
        """Cancel the work; return True if there was any."""
        if self.job is None:
            return False
        self.job.cancel()
        self._context.redraw()
        return True

    def start(self, photo: Photo) -> None:
        """Find the face in ``photo`` of the session."""
        if self._job is not None:
            return
        self._session, self._photo = self._context.session, photo
        model = self._session.model

        def work(progress: Progress) -> "tuple[PhotoExpression, str]":
            # Imported late to shorten the start of the window.
            from faceposer.photo.automatic import expression_of
            from faceposer.photo.faces import note_of_others, read_face

            progress.at("Finding the face")
            found = read_face(Path(photo.path), photo.focal)
            progress.at("Taking the expression")
            return expression_of(found, model), note_of_others(found)

        self._job = ThreadJob(work, self._context.wake, "Finding the face")
        self._context.redraw()

    def update(self) -> None:
        """Pose the face once the expression is known, unless the photo is gone.

        Raises:
            Exception: The error of the work, unless the user can resolve it; then a dialog shows it.
        """
        job = self._job
        if job is None or not job.done or self._context.busy:
            return
        self._job = None
        self._context.redraw()
        if isinstance(job.error, FacePoserError):
            self._context.dialogs.report("No expression was taken", str(job.error))
        elif job.error is not None:
            raise job.error
        elif job.result is not None and self._session is self._context.session:
            taken, note = job.result
            self._apply(taken)
            if note:
                self._context.notify(note)

    def _apply(self, taken: "PhotoExpression") -> None:
        session, before = self._context.session, self._photo
        photos = session.document.photos
        if before not in photos:
            return
        index = photos.index(before)
        photo = replace(taken.photo, visible=before.visible, opacity=before.opacity, front=before.front)
        document = replace(session.document, photos=(*photos[:index], photo, *photos[index + 1 :]), constraints=())
        with session.edit("Take the expression"):
            session.set_without_history(document.with_start(taken.pose).posed(taken.pose))
        self._done()

    def join(self) -> None:
        """Wait for the work."""
        if self._job is not None:
            self._job.join()
