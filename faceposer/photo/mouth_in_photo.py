"""Where a photo shows teeth or the dark of a mouth, which belong to no lip.

The lips of a model and of its photo are never exactly the same, so what the photo has beside the model's opening is
told apart by its colours: teeth are brighter and less red than lips and skin, and the dark between the lips is darker.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.photo.head_in_photo import HeadInPhoto
from faceposer.photo.light_in_parts import once_per_head

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Distance from the model's opening, in heights of the head, up to which teeth and dark of the photo belong to it: about
# one and a half heights of a lip; and half the width of gaps between them that belong to it, too.
_NEAR, _GAPS = 0.06, 0.012
# Brightness relative to that of the lips below which it is dark between them, and above which there may be teeth; their
# greatest redness relative to that of skin.
_DARK, _BRIGHT, _PALE = 0.6, 1.0, 0.85
# Least redness of skin, a logarithm, that tells teeth from it, and the brightness of teeth, relative to that of the
# lips, where none does, as in grey photos.
_COLOURED, _GREY_BRIGHT = 0.08, 1.5
_BLACK = 0.02


@once_per_head
def away_from_mouth(head: HeadInPhoto) -> Array:
    """Return the distance of each pixel from the inside of the mouth, or from where closed lips meet, (h, w).

    Teeth and dark of the photo that join it belong to it.
    """
    upper, lower = lips_in(head)
    opening = head.shown(head.inside) | (upper & ndimage.binary_dilation(lower))
    if not opening.any():
        return np.full(upper.shape, float(upper.shape[0]))
    near = ndimage.distance_transform_edt(~opening) < _NEAR * head.head_height
    joined = ndimage.binary_propagation(opening, mask=opening | near & _no_lips(head, upper | lower, opening))
    # Shaded gaps between teeth have the colours of skin.
    gaps = _GAPS * head.head_height
    grown = ndimage.distance_transform_edt(~joined) <= gaps
    joined |= near & (ndimage.distance_transform_edt(grown) > gaps)
    result: Array = ndimage.distance_transform_edt(~joined)
    return result


def lips_in(head: HeadInPhoto) -> tuple[Mask, Mask]:
    """Return which pixels of the grid show the upper and the lower lip of the model, (h, w) each."""
    upper, lower = (head.shown(head.of_regions((name,)) & ~head.inside) for name in ("lip_upper", "lip_lower"))
    return upper, lower


def _no_lips(head: HeadInPhoto, lips: Mask, opening: Mask) -> Mask:
    """Return which pixels of the grid have the colours of teeth, or are dark, beside those of ``lips``, (h, w)."""
    colours = np.maximum(head.picture.astype(np.float64), _BLACK)
    brightness = colours.mean(axis=2)
    if not lips.any():
        return np.zeros(lips.shape, dtype=bool)
    # The middles of both lips are surest to be lips in the photo.
    deep = ndimage.distance_transform_edt(lips)
    middle = lips & (deep >= np.median(deep[lips])) & ~opening
    usual = float(np.median(brightness[middle if middle.any() else lips]))
    red = np.log(colours[..., 0] / colours[..., 1])
    tint = np.log(np.maximum(head.tint, _BLACK))
    skin = float(tint[0] - tint[1])
    if skin > _COLOURED:
        teeth = (brightness > _BRIGHT * usual) & (red < _PALE * skin)
    else:
        teeth = brightness > _GREY_BRIGHT * usual
    result: Mask = teeth | (brightness < _DARK * usual)
    return result
