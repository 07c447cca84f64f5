"""Pictures of landmarks, drawn over the image in which they were found."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.files.atomic import atomic_file
from faceposer.landmarks.feature_points import FeaturePlace, feature_pixels
from faceposer.landmarks.on_meshes import MeshLandmarks
from faceposer.landmarks.points import Landmarks

Array = NDArray[np.float64]
Image = NDArray[np.uint8]

_GREEN, _RED, _YELLOW, _BLUE = (60, 230, 90), (255, 70, 60), (255, 210, 0), (70, 130, 255)
# Sides of the picture of a photo, and enlargement of the views of a mesh.
_LEAST_SIDE, _MOST_SIDE, _ENLARGED = 1200, 2400, 2
# Space around the faces in a picture of a photo, as a share of the largest face.
_MARGIN = 0.4


def photo_overlay(image: Image, faces: Sequence[Landmarks]) -> Image:
    """Return the part of ``image``, (h, w, 3), around ``faces``, with their points, irises and feature points."""
    boxes = np.stack([face.box for face in faces])
    margin = _MARGIN * float((boxes[:, 2:] - boxes[:, :2]).max())
    height, width = image.shape[:2]
    low = np.floor(np.clip(boxes[:, :2].min(axis=0) - margin, 0, (width - 1, height - 1))).astype(int)
    high = np.ceil(np.clip(boxes[:, 2:].max(axis=0) + margin, low + 1, (width, height))).astype(int)
    part = image[low[1] : high[1], low[0] : high[0]]
    largest = max(part.shape[:2])
    scale = min(max(_LEAST_SIDE / largest, 1.0), _MOST_SIDE / largest)
    picture = _resized(part, scale)
    for face in faces:
        radius = max(1.0, float((face.box[2:] - face.box[:2]).max()) * scale / 350.0)
        _mark(picture, (face.points[:, :2] - low) * scale, _GREEN, radius)
        _mark(picture, (face.iris.reshape(-1, 3)[:, :2] - low) * scale, _RED, radius)
        features = np.array([*feature_pixels(face).values()]).reshape(-1, 2)
        _mark(picture, (features - low) * scale, _YELLOW, 1.5 * radius)
    return picture


def mesh_overlay(found: MeshLandmarks, features: Mapping[str, FeaturePlace]) -> Image:
    """Return the views of a mesh side by side, from its right to its left, with its points and ``features``.

    Only those that face the camera are shown; extrapolated feature points are blue.
    """
    views = sorted(found.views, key=lambda view: float(view.camera.rotation[2] @ found.frame.rotation[0]))
    pictures = []
    for view in reversed(views):
        picture = _resized(view.drawing.image, float(_ENLARGED))
        places = np.array([feature.place for feature in features.values()]).reshape(-1, 3)
        guessed = np.array([feature.extrapolated for feature in features.values()], dtype=bool)
        points = found.points[np.isfinite(found.points).all(axis=1)]
        groups = ((points, _GREEN, 1.5), (places[~guessed], _YELLOW, 2.5), (places[guessed], _BLUE, 2.5))
        for group, colour, radius in groups:
            shown = [place for place in group if view.shows(place)]
            if shown:
                _mark(picture, view.camera.project(np.array(shown)) * _ENLARGED, colour, radius)
        pictures.append(picture)
    return np.hstack(pictures)


def write_picture(path: Path, image: Image) -> None:
    """Write ``image``, (h, w, 3), as PNG.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    from PIL import Image as Images

    with atomic_file(path, "image") as temporary:
        Images.fromarray(image).save(temporary, format="PNG")


def _resized(image: Image, scale: float) -> Image:
    from PIL import Image as Images

    height, width = image.shape[:2]
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    return np.array(Images.fromarray(image).resize(size, Images.Resampling.LANCZOS), dtype=np.uint8)


def _mark(picture: Image, pixels: Array | Iterable[tuple[float, float]], colour: Sequence[int], radius: float) -> None:
    """Draw discs of ``radius`` with a dark edge at ``pixels`` into ``picture``."""
    height, width = picture.shape[:2]
    reach = int(np.ceil(radius)) + 1
    rows, columns = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    distance = np.hypot(rows, columns)
    for edge, value in ((True, (0, 0, 0)), (False, colour)):
        inside = distance <= radius + (0.8 if edge else 0.0)
        for u, v in pixels:
            at_row, at_column = rows[inside] + int(np.floor(v)), columns[inside] + int(np.floor(u))
            kept = (at_row >= 0) & (at_row < height) & (at_column >= 0) & (at_column < width)
            if edge:
                picture[at_row[kept], at_column[kept]] //= 2
            else:
                picture[at_row[kept], at_column[kept]] = value
