"""The work of the dialog in the background: the fit with pictures of it, and its distance map."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.alignment import Similarity
from faceposer.geometry.camera import Camera
from faceposer.gui.features.head_making.contents import Compared, MadeHead
from faceposer.gui.features.head_making.previews import SIDE, Previews
from faceposer.gui.features.scan.marked_scan import MarkedScan
from faceposer.identity.scans.head_from_scans import ScanFitSoFar, doubts, head_from_scans, shipped_basis
from faceposer.identity.scans.pictures import distance_map
from faceposer.identity.scans.scanned_character import scanned_character
from faceposer.landmarks.drawing import PaintedMesh, draw
from faceposer.landmarks.painting import painted_parts
from faceposer.model.character import Character
from faceposer.model.character_names import checked_title, file_stem
from faceposer.progress import Progress

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class ScanHead(MadeHead):
    """The character, and the scans that it was made of.

    Attributes:
        compared: The distance map, then the scans and the head over each.
    """

    compared: tuple[Compared, ...]

    @property
    def views(self) -> Sequence[Compared]:
        """The distance map, then the scans, and over them the head."""
        return self.compared


def fit_head(
    marked: Sequence[MarkedScan],
    detail: bool,
    texture: bool,
    title: str,
    show: Callable[[Pixels], None],
    progress: Progress,
) -> MadeHead:
    """Make a character of the scans.

    Args:
        marked: The scans with their landmarks.
        detail: Follow the scan beyond the model of heads.
        texture: Take the colours of the scan.
        title: Title of the character.
        show: Called with pictures of the fit.
        progress: Progress to update.

    Raises:
        FacePoserError: If the landmarks do not match a scan.
        CancelledError: If the user has cancelled the work.
    """
    scans = [one.with_landmarks() for one in marked]
    shown = checked_title(title or "Head")
    previews, triangles = Previews(show), shipped_basis().triangles

    def watch(fit: ScanFitSoFar) -> None:
        def picture() -> Pixels:
            mesh = PaintedMesh(_on_picture(marked[0], fit.frame(0), fit.vertices(0)), triangles)
            return _over(marked[0], mesh, SIDE)

        previews.draw(picture)

    made = head_from_scans(scans, detail, texture, progress.part(0.0, 0.75), watch=watch)
    progress.at("Making the character", 0.75)
    character = scanned_character(made, file_stem(shown), shown)
    progress.at("Drawing the head", 0.88)
    distances = distance_map(shipped_basis(), made.scans[0])
    progress.at("Drawing the head", 0.94)
    compared = [Compared("Distances", distances)]
    for one, fitted in zip(marked, made.scans, strict=True):
        head = _on_picture(one, fitted.frame, fitted.posed)
        over = _over(one, _painted(character, head), max(one.camera.size))
        compared.append(Compared(one.name, one.image, over))
        progress.check()
    report = made.report
    text = (
        f"Distance of the face from the scan: {report['surface_mm_median']:.2f} mm in the median and "
        f"{report['surface_mm_mean']:.2f} mm in the mean of the {report['used']:.0%} of the face that lie on it. "
        "Distances: left the scan, middle the head, right the distance, from blue at 0 to red at 2 mm and more. Hair, "
        "lids, ears and neck are not followed."
    )
    return ScanHead(character, text, distances, tuple(compared), doubt=doubts(made))


def _on_picture(marked: MarkedScan, frame: Similarity, vertices: Array) -> Array:
    """Return ``vertices`` in the frame of the head, to which ``frame`` leads from the scan, where the picture is."""
    return marked.frame.apply(frame.inverse().apply(vertices))


def _over(marked: MarkedScan, mesh: PaintedMesh, side: int) -> Pixels:
    """Return the picture of the scan with ``side`` pixels and the head ``mesh`` over it."""
    camera: Camera = marked.camera.resized((side, side))
    drawing = draw(mesh, camera)
    return np.where(drawing.faces[..., None] >= 0, drawing.image, marked.picture(side))


def _painted(character: Character, skin: Array) -> PaintedMesh:
    """Return the skin of ``character`` at the places ``skin``, and its eyes, with their textures."""
    vertices = character.vertices.astype(np.float64)
    vertices[: len(skin)] = skin
    parts = [part for part in character.parts if part.material in ("skin", "eye")]
    return painted_parts(vertices, character.polygons, character.uv, character.polygon_uvs, parts, character.textures)
