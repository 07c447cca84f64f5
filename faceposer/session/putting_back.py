"""The face of a session put back into one of its photos."""

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.errors import FacePoserError
from faceposer.identity.identity import Identity
from faceposer.model.face_model import FaceModel
from faceposer.photo.head_in_photo import SIDE, HeadInPhoto
from faceposer.photo.photo import Photo
from faceposer.photo.putting_back import put_back
from faceposer.photo.reading import inspect_photo, read_photo
from faceposer.progress import Progress
from faceposer.session.session import Session

if TYPE_CHECKING:
    from faceposer.identity.identity import SkinTexture

# Side of the image in which the colour of skin changes, its blur, and limit of the change of its logarithm.
_SKIN, _GRAIN, _MOST_CHANGE = 256, 0.5, 0.6
# Changes of the labels of skins below which its colours stay.
_SAME = 0.02


def head_in_photo(model: FaceModel, photo: Photo, largest: int | None = None, side: int = SIDE) -> HeadInPhoto:
    """Return the head of the character of ``model`` as ``photo`` shows it.

    Args:
        model: The face model of the character before its head was edited.
        photo: The photo.
        largest: Longest side to which its pixels are reduced; None for all of them.
        side: Longest side of the grid on which changes are computed.

    Raises:
        FacePoserError: If the file cannot be read or is not the one of which the expression was taken, the expression
            in the photo is unknown, or the head is outside it.
    """
    pose = photo.pose_of(model)
    if pose is None or photo.camera is None:
        raise FacePoserError(
            f"It is not known how '{photo.name}' shows the face of '{model.character.title}'; take its expression "
            "first (Take the expression in the window, or faceposer photo CHARACTER PHOTO --auto)."
        )
    path = Path(photo.path)
    size = inspect_photo(path).size
    if size != photo.size:
        raise FacePoserError(
            f"The photo '{photo.path}' has {size[0]} x {size[1]} pixels, but the session was made with "
            f"{photo.size[0]} x {photo.size[1]}; put the photo back, or take its expression again."
        )
    pixels = read_photo(path, largest)
    return HeadInPhoto.of(model.character, model.surface(pose), photo.camera, pixels, side, photo.name)


def photo_with_face(session: Session, index: int = 0, progress: Progress | None = None) -> NDArray[np.uint8]:
    """Return photo ``index`` of ``session`` with the face as it is now, in the photo's light, shape (h, w, 3).

    Raises:
        FacePoserError: As `head_in_photo`, or if there is no such photo.
    """
    photos = session.document.photos
    if not 0 <= index < len(photos):
        raise FacePoserError(
            f"The session has no photo {index + 1}; it has {len(photos)}."
            if photos
            else "The session has no photo to put the face back into; add one with faceposer photo."
        )
    head = head_in_photo(session.base_model, photos[index])
    return put_back(head, session.vertices, skin_change(session.base_model, session.document.identity), progress)


@lru_cache(maxsize=4)
def skin_change(model: FaceModel, identity: Identity | None) -> NDArray[np.float32] | None:
    """Return by what the logarithm of the skin's colours changes with age and gender, or None if it does not.

    Args:
        model: The face model of the character.
        identity: Its edited head; None for its own.

    Returns:
        An image in the layout of the skin, first row at v = 1, shape (size, size, 3).
    """
    if identity is None:
        return None
    from faceposer.identity.editing import head_editor
    from faceposer.identity.identity import is_editable
    from faceposer.identity.skin_following import NATURAL_LABELS, following_skin

    if not is_editable(model.character):
        return None
    editor = head_editor(model.character)
    before, after = editor.measure(editor.own), editor.measure(identity)
    if all(abs(after[name] - before[name]) < _SAME for name in NATURAL_LABELS):
        return None
    own, log = _own_skin(model)
    # The grain of the pores is not the person's.
    change = ndimage.gaussian_filter(_log_of(following_skin(own, before, after)) - log, (_GRAIN, _GRAIN, 0.0))
    # The tone is the person's, whatever the skins of a few old and young people have.
    change -= np.median(change, axis=(0, 1))
    return np.clip(change, -_MOST_CHANGE, _MOST_CHANGE)


@lru_cache(maxsize=2)
def _own_skin(model: FaceModel) -> "tuple[SkinTexture, NDArray[np.float32]]":
    """Return the skin of the character of ``model`` and the logarithm of its bare colours."""
    from faceposer.identity.editing import head_editor

    own = head_editor(model.character).own_texture()
    return own, _log_of(own)


def _log_of(skin: "SkinTexture") -> NDArray[np.float32]:
    """Return the logarithm of the colours of a ``skin`` without hair, shape (size, size, 3)."""
    from faceposer.identity.skin_layers import SkinLayers
    from faceposer.identity.texture_model import load_texture_model

    bare = SkinLayers(hair="none", brows="none", beard=0.0)
    colours = load_texture_model().instance(skin.coefficients, bare, _SKIN).astype(np.float32)
    result: NDArray[np.float32] = np.log(np.maximum(colours, 3.0))
    return result
