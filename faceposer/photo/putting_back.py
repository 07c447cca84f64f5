"""A changed head put back into its photo (Blanz and Vetter 1999, section 6 and figures 6 to 8).

Each pixel that shows the changed head shows a point of its surface. The photo has the colours of that point where the
head had it before; they change as the light on the point does. So an unchanged head gives back the photo itself,
whatever the model does not know, as in the relative changes by which the paper paints. Around the head the photo is
warped along, less with the distance, so that no hole opens where a head gets slimmer, and hair follows. What
the photo did not show, as teeth behind closed lips, is drawn with the model's colours in the photo's light.
"""

import numpy as np
from numpy.typing import NDArray

from faceposer.photo.drawn_parts import DrawnParts
from faceposer.photo.extending import smooth_step
from faceposer.photo.following import Following
from faceposer.photo.glasses_in_photo import Glasses
from faceposer.photo.head_in_photo import HeadInPhoto
from faceposer.photo.strips import PhotoChange, with_change
from faceposer.progress import Progress

Array = NDArray[np.float64]
Image32 = NDArray[np.float32]

# Cosine between skin and view from which the change of its colours is seen.
_FACING = 0.5
_STEP = "Putting the face back"


def put_back(
    head: HeadInPhoto,
    vertices: NDArray[np.floating],
    skin: Image32 | None = None,
    progress: Progress | None = None,
) -> NDArray[np.uint8]:
    """Return the photo of ``head`` with other vertices, (N, 3), in its light, shape (h, w, 3).

    Args:
        head: The head in the photo.
        vertices: The changed head.
        skin: Logarithm of the change of the skin's colours, in the layout of its texture, shape (size, size, 3); None
            for none.
        progress: Progress and cancellation.

    Raises:
        FacePoserError: If the photo shows too little of the face.
        CancelledError: If the user has cancelled the work.
    """
    change = photo_change(head, np.asarray(vertices, dtype=np.float64), skin, progress)
    left, top, right, bottom = head.box
    result = head.pixels.copy()
    result[top:bottom, left:right] = with_change(head.pixels[top:bottom, left:right], change, progress)
    return result


def photo_change(
    head: HeadInPhoto, vertices: Array, skin: Image32 | None = None, progress: Progress | None = None
) -> PhotoChange:
    """Return how the photo changes if ``head`` gets ``vertices``, (N, 3); the others are as for `put_back`."""
    progress = progress or Progress()
    progress.at(_STEP)
    following = Following.of(head, vertices)
    progress.at(_STEP)
    light = following.light
    if skin is not None:
        seen = smooth_step(following.facing, (0.0, _FACING))[:, None]
        light.reshape(-1, 3)[following.surface.at] += seen * _change_of_skin(head, following, skin)
    parts = DrawnParts.of(head, vertices, following)
    progress.at(_STEP)
    offsets, share = following.offsets, parts.share
    glasses = Glasses.before(head, vertices)
    if glasses is not None:
        offsets = offsets + glasses.near[..., None] * (glasses.offsets - offsets)
        light = (1.0 - glasses.frame)[..., None] * light
        share = (1.0 - glasses.frame) * share
    return PhotoChange(offsets, light, share, parts.colours)


def _change_of_skin(head: HeadInPhoto, following: Following, skin: Image32) -> Array:
    """Return the ``skin``'s change of colours on the face at the pixels of the changed head, (n, 3)."""
    surface = following.surface
    result = surface.of_vertices(head.face[:, None]) * surface.looked_up(head.character, skin)
    result[head.inside[surface.faces[surface.at]]] = 0.0
    return result
