"""The face put back into photos of its session (docs/photo.md)."""

import numpy as np
from numpy.typing import NDArray

from faceposer.api import checks
from faceposer.api.posing import PathName
from faceposer.errors import FacePoserError
from faceposer.session.session import Session


class PhotosMixin:
    """Photos of a face.

    Attributes:
        session: The document with its history.
    """

    session: Session

    def put_back(self, photo: int = 0, path: PathName | None = None) -> NDArray[np.uint8]:
        """Return a photo of the session with the face as it is now, in the photo's light, shape (h, w, 3).

        Pixels that the changes do not reach are those of the photo.

        Args:
            photo: Its index, from 0.
            path: PNG file to write as well.

        Raises:
            FacePoserError: If there is no such photo, its file cannot be read, its expression is unknown, or the file
                cannot be written or is a photo of the session.
        """
        from faceposer.files.atomic import check_output
        from faceposer.session.photos import check_no_photo
        from faceposer.session.putting_back import photo_with_face

        if isinstance(photo, bool) or not isinstance(photo, (int, np.integer)):
            raise FacePoserError("The number of a photo must be a whole number, from 0.")
        if path is not None:
            target = checks.file_path(path)
            check_output(target, ".png")
            check_no_photo(self.session.document, target)
        picture = photo_with_face(self.session, int(photo))
        if path is not None:
            from faceposer.render.images import write_png

            write_png(target, picture)
        return picture
