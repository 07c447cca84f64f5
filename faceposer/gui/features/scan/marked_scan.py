"""Scans with a picture of the face, and landmarks that can be moved."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from faceposer.geometry.alignment import Similarity
from faceposer.geometry.camera import Camera
from faceposer.identity.registration import align
from faceposer.identity.scans.head_from_scans import Scan, read_scan
from faceposer.identity.scans.landmarks_file import implied_features
from faceposer.identity.scans.scan import ScanLandmarks, find_scan_landmarks
from faceposer.landmarks.drawing import Drawing, draw
from faceposer.landmarks.reference import reference
from faceposer.progress import Progress

Array = NDArray[np.float64]

#: Feature points that can be moved: corners and middles of eyes, brows, nose, lips and chin.
MOVABLE = (
    *("3.7", "3.11", "3.1", "3.9", "3.8", "3.12", "3.2", "3.10"),
    *("4.1", "4.3", "4.5", "4.2", "4.4", "4.6"),
    *("9.1", "9.2", "9.3", "9.15", "8.1", "8.2", "8.3", "8.4", "2.1"),
)
# Side of the picture in pixels, width that it shows, and distance of the camera, in centimetres.
_SIDE, _WIDTH, _DISTANCE = 1080, 21.0, 90.0
# Sine of the angle between view and surface below which the pixel does not determine the place on it.
_EDGE_ON = 0.05


@dataclass(frozen=True, eq=False)
class MarkedScan:
    """A scan with a picture of its face, and its landmarks in it.

    Attributes:
        scan: The scan.
        frame: The similarity from the scan to upright centimetres.
        camera: Camera of the picture.
        drawing: The picture, with the place on the surface under each pixel in upright centimetres.
        found_places: Where the movable feature points were found in upright centimetres, by name.
        placed: Where the user has moved some of them.
    """

    scan: Scan
    frame: Similarity
    camera: Camera
    drawing: Drawing
    found_places: Mapping[str, Array]
    placed: Mapping[str, Array] = field(default_factory=dict)
    note: ClassVar[str] = ""

    @property
    def name(self) -> str:
        """Name of the file."""
        return self.scan.name

    @property
    def image(self) -> NDArray[np.uint8]:
        """The picture, shape (h, w, 3)."""
        return self.drawing.image

    @property
    def moved(self) -> frozenset[str]:
        """Names of the feature points that the user has moved."""
        return frozenset(self.placed)

    @property
    def places(self) -> dict[str, Array]:
        """Places of the movable feature points in upright centimetres, by name."""
        return {**self.found_places, **self.placed}

    @cached_property
    def found_pixels(self) -> dict[str, tuple[float, float]]:
        """Pixels at which the movable feature points were found, by name."""
        return self._projected(self.found_places)

    @cached_property
    def pixels(self) -> dict[str, tuple[float, float]]:
        """Pixels of the movable feature points, by name."""
        return self._projected(self.places)

    def _projected(self, places: Mapping[str, Array]) -> dict[str, tuple[float, float]]:
        projected = self.camera.project(np.stack(list(places.values()))).tolist()
        return {name: (u, v) for name, (u, v) in zip(places, projected, strict=True)}

    def with_moved(self, name: str, pixel: tuple[float, float]) -> "MarkedScan":
        """Return the scan with feature point ``name`` at ``pixel`` of the picture, or as it is off the surface."""
        height, width = self.drawing.faces.shape
        column, row = int(np.clip(pixel[0], 0, width - 1)), int(np.clip(pixel[1], 0, height - 1))
        face = int(self.drawing.faces[row, column])
        if face < 0:
            return self
        corners = self.frame.apply(self.scan.mesh.vertices[self.scan.mesh.triangles[face]])
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        origin, direction = self.camera.ray(pixel)
        across = float(normal @ direction)
        # The plane of the triangle under the pixel, exactly; its middle where it is seen edge-on.
        place = self.drawing.places[row, column]
        if abs(across) > _EDGE_ON * float(np.linalg.norm(normal)):
            place = origin + direction * float(normal @ (corners[0] - origin)) / across
        return replace(self, placed={**self.placed, name: place})

    def with_reset(self, names: Collection[str]) -> "MarkedScan":
        """Return the scan with the feature points ``names`` where they were found."""
        return replace(self, placed={name: place for name, place in self.placed.items() if name not in names})

    def picture(self, side: int) -> NDArray[np.uint8]:
        """Return the picture with ``side`` pixels."""
        if side == self.image.shape[0]:
            return self.image
        return np.asarray(Image.fromarray(self.image).resize((side, side), Image.Resampling.LANCZOS))

    def with_landmarks(self) -> Scan:
        """Return the scan with its landmarks, those that were moved included."""
        landmarks = self.scan.landmarks
        assert landmarks is not None
        back = self.frame.inverse()
        features = {name: back.apply(place[None])[0] for name, place in self.placed.items()}
        return replace(self.scan, landmarks=ScanLandmarks(landmarks.points, landmarks.spread, features))


def find_landmarks(files: Sequence[str], progress: Progress) -> list[MarkedScan]:
    """Read the scans and find their landmarks.

    Raises:
        FacePoserError: If a file cannot be read, or no face is found.
        CancelledError: If the user has cancelled the work.
    """
    marked = []
    for number, path in enumerate(files):
        part = progress.part(number / len(files), (number + 1) / len(files))
        part.at("Reading the scan" if len(files) == 1 else f"Reading scan {number + 1} of {len(files)}", 0.02)
        scan = read_scan(path)
        mesh, landmarks = find_scan_landmarks(scan.mesh, scan.label, part.part(0.1, 0.95))
        part.at("Drawing the scan", 0.95)
        marked.append(_marked(replace(scan, mesh=mesh, landmarks=landmarks)))
    return marked


def _marked(scan: Scan) -> MarkedScan:
    landmarks = scan.landmarks
    assert landmarks is not None
    known = np.isfinite(landmarks.points).all(axis=1)
    frame = align(landmarks.points[known], reference().places[known])
    camera = _camera(frame.apply(landmarks.points[known]).mean(axis=0))
    drawing = draw(replace(scan.mesh, vertices=frame.apply(scan.mesh.vertices)), camera)
    implied = implied_features(landmarks, MOVABLE)
    places = {name: frame.apply(place[None])[0] for name, place in implied.items()}
    return MarkedScan(scan, frame, camera, drawing, places)


def _camera(middle: Array) -> Camera:
    rotation = np.diag([1.0, -1.0, -1.0])
    centre = middle + [0.0, 0.0, _DISTANCE]
    return Camera(rotation, -rotation @ centre, _SIDE * _DISTANCE / _WIDTH, (_SIDE, _SIDE))
