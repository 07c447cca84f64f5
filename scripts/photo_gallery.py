"""Draw ``docs/images/photo-heads.jpg``: photos, and the heads made of them, in their pose, turned and with expressions.

Run from the root of a checkout, with photos that may be shown (docs/photo-heads.md names those of the page)::

    python -m scripts.photo_gallery astronaut.png grace_hopper.jpg [--cells DIR]
    python -m scripts.photo_gallery --painting MonaLisa.jpg --output docs/images/painting-head.jpg
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.geometry.camera import Camera, OrbitView
from faceposer.identity.photos.head_from_photos import HeadFromPhotos, head_from_photos
from faceposer.model.face_model import FaceModel
from faceposer.photo.faces import FaceInPhoto, read_face
from faceposer.poses.applying import weights_on
from faceposer.poses.library import starter_poses
from faceposer.render.offscreen import render_character

Pixels = NDArray[np.uint8]

_WIDTH, _HEIGHT, _QUALITY = 360, 420, 88
# Height of the photo around the face, in heights of the face, and where its middle lies.
_ROOM, _MIDDLE = 1.8, 0.42
# Names, expression and turn of the views after that of the photo.
_VIEWS = (
    ("neutral", "", 0.0),
    ("smile", "Happiness", 0.6),
    ("frown", "Anger", 0.0),
    ("closed", "eyes", 0.0),
    ("side", "", -1.35),
)


def cells_of(path: Path, size: tuple[int, int], painting: bool = False) -> dict[str, Pixels]:
    """Return the photo ``path`` about the face, and pictures of the head made of it, by name."""
    read = read_face(path)
    head = head_from_photos([read.face], [read.pixels], [str(path)], name="photo", title="Photo", painting=painting)
    model = head.model
    cells = {"photo": _photo(read, size), "pose": _in_photo(head, read, size)}
    for name, expression, yaw in _VIEWS:
        surface = model.surface(model.coefficients_of(_weights(model, expression)))
        cells[name] = render_character(model.character, surface, _camera(model, yaw, size))
    return cells


def _weights(model: FaceModel, expression: str) -> NDArray[np.float64]:
    names = model.character.shape_names
    if expression in ("", "eyes"):
        return np.array([float(bool(expression) and name.startswith("eyeBlink")) for name in names])
    pose = next(entry.pose for entry in starter_poses() if entry.pose is not None and entry.pose.name == expression)
    weights = weights_on(pose, model.character)
    assert weights is not None
    return weights


def _window(read: FaceInPhoto, size: tuple[int, int]) -> tuple[float, tuple[float, float]]:
    """Return pixels of the picture per pixel of the photo, and the photo's pixel at its corner."""
    points = read.face.landmarks.points[:, :2]
    low, high = points.min(axis=0), points.max(axis=0)
    factor = size[1] / (_ROOM * float(high[1] - low[1]))
    middle = (low + high) / 2.0
    return factor, (middle[0] - 0.5 * size[0] / factor, middle[1] - _MIDDLE * _ROOM * float(high[1] - low[1]) * 1.2)


def _photo(read: FaceInPhoto, size: tuple[int, int]) -> Pixels:
    factor, (x, y) = _window(read, size)
    box = (x, y, x + size[0] / factor, y + size[1] / factor)
    picture = Image.fromarray(read.pixels).transform(size, Image.Transform.EXTENT, box, Image.Resampling.BICUBIC)
    return np.asarray(picture)


def _in_photo(head: HeadFromPhotos, read: FaceInPhoto, size: tuple[int, int]) -> Pixels:
    factor, corner = _window(read, size)
    camera = head.cameras[0]
    principal = (camera.principal_point - corner) * factor
    shift = (float(principal[0]) - size[0] / 2.0, float(principal[1]) - size[1] / 2.0)
    seen = Camera(camera.rotation, camera.translation, camera.focal * factor, size, shift)
    return render_character(head.character, head.model.surface(head.poses[0]), seen)


def _camera(model: FaceModel, yaw: float, size: tuple[int, int]) -> Camera:
    character = model.character
    middle = character.vertices[character.regions["nose"]].mean(axis=0)
    target = (0.0, float(middle[1]) + 0.5, float(middle[2]) - 6.0)
    return OrbitView(target, yaw, 0.0, distance=84.0).camera(size)


def main() -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("photos", type=Path, nargs="+", help="photos of one person each, a row of the picture each")
    parser.add_argument("--output", type=Path, default=ROOT / "docs" / "images" / "photo-heads.jpg")
    parser.add_argument("--cells", type=Path, help="folder for the single pictures, three times as large, instead")
    parser.add_argument("--painting", action="store_true", help="the photos are of paintings or drawings")
    options = parser.parse_args()
    factor = 3 if options.cells else 1
    rows = []
    for path in options.photos:
        cells = cells_of(path, (factor * _WIDTH, factor * _HEIGHT), options.painting)
        rows.append(np.hstack(list(cells.values())))
        for name, pixels in cells.items() if options.cells else ():
            options.cells.mkdir(parents=True, exist_ok=True)
            Image.fromarray(pixels).save(options.cells / f"{path.stem}-{name}.png")
    if not options.cells:
        Image.fromarray(np.vstack(rows)).save(options.output, "JPEG", quality=_QUALITY)
        print(options.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
