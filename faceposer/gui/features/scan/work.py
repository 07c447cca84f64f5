"""The work of the dialog in the background: landmarks of scans with pictures, and the fit with its distance map."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.alignment import Similarity
from faceposer.geometry.camera import Camera
from faceposer.gui.features.head_making.state import MadeHead
from faceposer.identity.registration import align
from faceposer.identity.scans.head_from_scans import Scan, doubts, head_from_scans, read_scan, shipped_basis
from faceposer.identity.scans.landmarks_file import implied_features
from faceposer.identity.scans.pictures import distance_map
from faceposer.identity.scans.scan import ScanLandmarks, find_scan_landmarks
from faceposer.identity.scans.scanned_character import scanned_character
from faceposer.landmarks.drawing import Drawing, draw
from faceposer.landmarks.reference import reference
from faceposer.model.character_names import checked_title, file_stem
from faceposer.progress import Progress

Array = NDArray[np.float64]

#: Feature points that can be moved: corners and middles of eyes, brows, nose, lips and chin.
MOVABLE = (
    *("3.7", "3.11", "3.1", "3.9", "3.8", "3.12", "3.2", "3.10"),
    *("4.1", "4.3", "4.5", "4.2", "4.4", "4.6"),
    *("9.1", "9.2", "9.3", "9.15", "8.1", "8.2", "8.3", "8.4", "2.1"),
)
# Side of the picture in pixels, width that it shows, and distance of the camera, in centimetres.
_SIDE, _WIDTH, _DISTANCE = 720, 21.0, 90.0
_TARGET = np.array([0.0, -1.0, 4.0])


@dataclass(frozen=True, eq=False)
class MarkedScan:
    """A scan with a picture of its face, and its landmarks in it.

    Attributes:
        scan: The scan.
        frame: The similarity from the scan to upright centimetres.
        camera: Camera of the picture.
        drawing: The picture, with the place on the surface under each pixel in upright centimetres.
        places: Places of the movable feature points in upright centimetres, by name.
        moved: Names of those that the user has moved.
    """

    scan: Scan
    frame: Similarity
    camera: Camera
    drawing: Drawing
    places: dict[str, Array]
    moved: frozenset[str] = frozenset()

    @property
    def name(self) -> str:
        """Name of the file."""
        return self.scan.name

    @property
    def image(self) -> NDArray[np.uint8]:
        """The picture, shape (h, w, 3)."""
        return self.drawing.image

    @property
    def pixels(self) -> dict[str, tuple[float, float]]:
        """Pixels of the movable feature points, by name."""
        projected = self.camera.project(np.stack(list(self.places.values()))).tolist()
        return {name: (u, v) for name, (u, v) in zip(self.places, projected, strict=True)}

    def with_moved(self, name: str, pixel: tuple[float, float]) -> "MarkedScan":
        """Return the scan with feature point ``name`` at ``pixel`` of the picture, or as it is off the surface."""
        height, width = self.drawing.faces.shape
        column, row = int(np.clip(pixel[0], 0, width - 1)), int(np.clip(pixel[1], 0, height - 1))
        place = self.drawing.places[row, column]
        if not np.isfinite(place).all():
            return self
        return replace(self, places={**self.places, name: place}, moved=self.moved | {name})

    def with_landmarks(self) -> Scan:
        """Return the scan with its landmarks, those that were moved included."""
        landmarks = self.scan.landmarks
        assert landmarks is not None
        back = self.frame.inverse()
        features = {name: back.apply(self.places[name][None])[0] for name in self.moved}
        return replace(self.scan, landmarks=ScanLandmarks(landmarks.points, landmarks.spread, features))


def find_landmarks(files: Sequence[str], progress: Progress) -> list[MarkedScan]:
    """Read the scans and find their landmarks.

    Raises:
        FacePoserError: If a file cannot be read, or no face is found.
        CancelledError: If the user has cancelled the work.
    """
    marked = []
    for path in files:
        progress.at("Reading the scan")
        scan = read_scan(path)
        progress.at("Finding the face")
        mesh, landmarks = find_scan_landmarks(scan.mesh, scan.label, progress)
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


def fit_head(marked: Sequence[MarkedScan], detail: bool, texture: bool, title: str, progress: Progress) -> MadeHead:
    """Make a character of the scans.

    Raises:
        FacePoserError: If the landmarks do not match a scan.
        CancelledError: If the user has cancelled the work.
    """
    scans = [one.with_landmarks() for one in marked]
    made = head_from_scans(scans, detail, texture, progress)
    progress.at("Making the character")
    shown = checked_title(title or "Head")
    character = scanned_character(made, file_stem(shown), shown)
    report = made.report
    text = (
        f"Distance of the face from the scan: {report['surface_mm_median']:.2f} mm in the median and "
        f"{report['surface_mm_mean']:.2f} mm in the mean of the {report['used']:.0%} of the face that lie on it. "
        "Left the scan, middle the head, right the distance, from blue at 0 to red at 2 mm and more. Hair, lids, ears "
        "and neck are not followed."
    )
    if said := doubts(made):
        text = f"{said} {text}"
    return MadeHead(character, text, distance_map(shipped_basis(), made.scans[0]))
