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

# Distances from the model's opening, in heights of the head, up to which dark of a closed mouth belongs to it, and
# teeth and dark of an open one: about one and a half heights of a lip. Half the width of gaps between them that belong
# to it, too, and the least height of an opening that shows teeth.
_CLOSED, _OPEN, _GAPS, _OPENED = 0.025, 0.06, 0.012, 0.012
# Brightness relative to that of the lips below which it is dark between closed lips and open ones.
_DARK, _DARK_OPEN = 0.5, 0.6
# Greatest redness of teeth relative to that of skin, and their least brightness relative to that of lips.
_PALE, _BRIGHT = 0.62, 0.9
# Blur of colours, in pixels of the photo, against noise.
_BLUR = 0.6
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
    opened = 2.0 * float(head.depth_in_mouth.max()) > _OPENED * head.head_height
    near = ndimage.distance_transform_edt(~opening) < (_OPEN if opened else _CLOSED) * head.head_height
    found = opening | near & _no_lips(head, upper | lower, opened)
    # Shaded gaps between teeth have the colours of skin.
    if opened:
        gaps = _GAPS * head.head_height
        grown = ndimage.distance_transform_edt(~found) <= gaps
        found |= near & (ndimage.distance_transform_edt(grown) > gaps)
    joined = ndimage.binary_propagation(opening, mask=found)
    result: Array = ndimage.distance_transform_edt(~joined)
    return result


def lips_in(head: HeadInPhoto) -> tuple[Mask, Mask]:
    """Return which pixels of the grid show the upper and the lower lip of the model, (h, w) each."""
    upper, lower = (head.shown(head.of_regions((name,)) & ~head.inside) for name in ("lip_upper", "lip_lower"))
    return upper, lower


def _no_lips(head: HeadInPhoto, lips: Mask, opened: bool) -> Mask:
    """Return which pixels of the grid have the colours of teeth, or are dark, beside those of ``lips``, (h, w)."""
    if not lips.any():
        return lips
    blur = _BLUR * head.pixel
    colours = np.maximum(ndimage.gaussian_filter(head.picture.astype(np.float64), (blur, blur, 0.0)), _BLACK)
    brightness = colours.mean(axis=2)
    usual = float(np.median(brightness[lips]))
    if not opened:
        return np.asarray(brightness < _DARK * usual)
    result: Mask = brightness < _DARK_OPEN * usual
    red = np.log(colours[..., 0] / colours[..., 1])
    skin = float(np.log(head.tint[0] / head.tint[1]))
    result |= (brightness > _BRIGHT * usual) & (red < _PALE * skin)
    return result
