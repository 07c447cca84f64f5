"""The light of paintings and drawings, as far as it can be told: how much brighter one side of the face is.

A painter's colours are not those of skin under a lamp (Blanz and Vetter 1999, section 6 and figure 8). So nothing is
taken for the colour of the light, and little for its strength: the face keeps the colours of the painting, and only the
relative change of brightness with the direction of the surface is taken away.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.identity.photos.face_camera import FaceCamera
from faceposer.identity.photos.harmonics import N_LIGHT
from faceposer.identity.photos.skin_samples import SkinSamples

Array = NDArray[np.float64]

# Blur of the picture in pixels, against lines and strokes.
_BLUR = 3.0
# Mean light on the face, and largest deviation from it.
_MEAN, _MOST = 0.95, 0.35
# Ridge on the slopes relative to the number of samples; residual from which a sample counts less; rounds.
_RIDGE, _DOUBTFUL, _ROUNDS = 0.05, 0.15, 6
# Least cosine between skin and view of a sample.
_FACING = 0.35


def painted_light(image: Array, camera: FaceCamera, vertices: Array, skin: SkinSamples) -> Array:
    """Return a grey light of degree 1 in camera axes, coefficients of `harmonics`, shape (9, 3).

    Args:
        image: The picture, 0 to 1, shape (h, w, 3).
        camera: Its camera.
        vertices: All vertices of the face in its expression, shape (N, 3).
        skin: Samples of the skin, whose usual brightness counts.
    """
    local = camera.local(vertices[skin.vertices])
    corners = local[skin.triangles]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), 1e-12)
    pixels = camera.pixels(corners.mean(axis=1))
    height, width = image.shape[:2]
    used = (normals[:, 2] < -_FACING) & (pixels >= 0.0).all(axis=1) & (pixels < (width, height)).all(axis=1)
    light = np.zeros((N_LIGHT, 3))
    light[0] = _MEAN
    if used.sum() < 100:
        return light
    grey = ndimage.gaussian_filter(image.mean(axis=2), _BLUR)
    brightness = ndimage.map_coordinates(grey, pixels[used][:, ::-1].T - 0.5, order=1, mode="nearest")
    usual = np.exp(skin.colour[used]).mean(axis=1)
    ratio = brightness / usual
    ratio = ratio / max(float(np.median(ratio)), 1e-3)
    rows = np.column_stack([np.ones(int(used.sum())), normals[used][:, [1, 2, 0]]])
    ridge = _RIDGE * len(rows) * np.diag([0.0, 1.0, 1.0, 1.0])
    weights, found = np.ones(len(rows)), np.zeros(4)
    for _ in range(_ROUNDS):
        weighted = rows * weights[:, None]
        found = np.linalg.solve(weighted.T @ rows + ridge, weighted.T @ ratio)
        weights = 1.0 / (1.0 + ((ratio - rows @ found) / _DOUBTFUL) ** 2)
    shade = rows @ found
    mean = max(float(shade.mean()), 1e-3)
    most = float(np.abs(shade / mean - 1.0).max())
    slopes = found[1:] / mean * min(1.0, _MOST / max(most, 1e-6))
    # The mean over the face stays.
    light[0] = _MEAN * (1.0 - float(rows[:, 1:].mean(axis=0) @ slopes))
    light[1:4] = _MEAN * slopes[:, None]
    return light
