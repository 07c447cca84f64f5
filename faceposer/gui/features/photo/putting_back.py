"""The photo with the face as it is now, in the view: computed in the background after each change."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import moderngl
import numpy as np
from numpy.typing import NDArray

from faceposer.gui.context import EditorContext
from faceposer.photo.photo import Photo
from faceposer.progress import Progress
from faceposer.render.offscreen import photo_texture
from faceposer.session.jobs import ThreadJob, outcome
from faceposer.session.session import Session

if TYPE_CHECKING:
    from faceposer.photo.head_in_photo import HeadInPhoto

# Longer side of the photo in the view, and that of the grid on which changes are computed there.
_LARGEST, _GRID = 1400, 500

Pixels = NDArray[np.uint8]
# How the photo shows the face, and the face that is put back into it.
State = tuple[object, object]


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
        self._asked: State | None = None
        self._shown: State | None = None
        self._texture: moderngl.Texture | None = None
        self._head: tuple[object, HeadInPhoto] | None = None
        # True once the face itself was shown after the last picture: it stays until there is a new one.
        self._left = False

    @staticmethod
    def possible(photo: Photo) -> bool:
        """Return True if it is known how ``photo`` shows the face."""
        return photo.expression is not None and photo.camera is not None

    @property
    def job(self) -> ThreadJob[Pixels] | None:
        """The work on a picture that is wanted, or None."""
        return self._job if self.on else None

    def switch(self, on: bool) -> None:
        """Show it, or photo and face again."""
        if on == self.on:
            return
        self.on, self._left = on, False
        if not on and self._job is not None:
            self._job.cancel()
        self._context.redraw()

    def picture(self, photo: Photo) -> moderngl.Texture | None:
        """Return the texture of ``photo`` with the face, or None if the face itself has to be shown.

        While a new picture is computed, the last one is returned, unless the face was shown since, as in gestures.
        """
        if not self.on or not self.possible(photo):
            return None
        if self._face_moves():
            self._left = True
            return None
        state = self._state(photo)
        if self._shown == state:
            self._left = False
            return self._texture
        if self._job is None:
            self._asked = state
            self._job = ThreadJob(self._work(self._context.session, photo), self._context.wake, "Reading the photo")
        elif self._asked != state:
            self._job.cancel()
        kept = self._shown is not None and self._shown[0] == state[0] and not self._left
        return self._texture if kept else None

    def _face_moves(self) -> bool:
        """Return True while the face itself must be seen: it is being changed, or compared with the neutral one."""
        context, session = self._context, self._context.session
        changing = context.toolbox.active or session.editing or session.solving or session.preview is not None
        return changing or context.playing or context.comparing

    def _state(self, photo: Photo) -> State:
        session = self._context.session
        before = (session, photo.path, photo.camera, photo.expression)
        pose = session.coefficients.tobytes()
        return before, (session.model, session.document.identity, session.document.contact, pose)

    def _work(self, session: Session, photo: Photo) -> Callable[[Progress], Pixels]:
        """Return the work for the present state of ``session``."""
        vertices, model, identity = session.vertices, session.base_model, session.document.identity
        key = (photo.path, photo.camera, photo.expression, model)

        def work(progress: Progress) -> Pixels:
            # Imported late to shorten the start of the window.
            from faceposer.photo.putting_back import put_back
            from faceposer.session.putting_back import head_in_photo, skin_change

            if self._head is None or self._head[0] != key:
                self._head = (key, head_in_photo(model, photo, _LARGEST, _GRID))
            progress.at("Putting the face back")
            return put_back(self._head[1], vertices, skin_change(model, identity), progress)

        return work

    def update(self) -> None:
        """Upload the picture once it is computed.

        Raises:
            Exception: The error of the work, unless the user can resolve it; then a dialog shows it.
        """
        job = self._job
        if job is None or not job.done:
            return
        self._job = None
        self._context.redraw()
        pixels, problem = outcome(job, "close other programs, or use a smaller photo.")
        if problem and self.on:
            self.on = False
            self._context.dialogs.report("The face cannot be put back into the photo", problem)
        elif pixels is not None and self._asked is not None:
            self._release_texture()
            self._texture, self._shown = photo_texture(self._context.gl, pixels), self._asked

    def forget(self) -> None:
        """Switch it off and forget the picture, such as for another session."""
        self.switch(False)
        self._release_texture()
        self._shown = self._asked = self._head = None

    def _release_texture(self) -> None:
        if self._texture is not None:
            self._texture.release()
            self._texture = None

    def join(self) -> None:
        """Wait for the work."""
        if self._job is not None:
            self._job.join()
