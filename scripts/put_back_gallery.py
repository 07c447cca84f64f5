"""Draw ``docs/images/put-back.jpg``: two photos, and the persons in them with other heads and expressions.

Run from the root of a checkout, with sessions that ``faceposer identity fit-photo --session`` wrote for photos that may
be shown (docs/photo-heads.md names those of the page)::

    python -m scripts.put_back_gallery astronaut.json grace_hopper.json
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

import faceposer
from faceposer.photo.reading import read_photo

_WIDTH, _HEIGHT, _QUALITY = 300, 330, 88
# Height of the part of the photo, in heights of the head, and where the middle of the head lies in it.
_ROOM, _MIDDLE = 1.12, 0.52
# Attributes, and a pose of the first person and of the second.
_CHANGES = (
    ({"weight": 2.2}, ("", "")),
    ({"weight": -2.0}, ("", "")),
    ({}, ("Anger", "Happiness")),
    ({}, ("Surprise", "Surprise")),
)


def main() -> None:
    """Draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sessions", nargs=2, type=Path, help="sessions of the two persons")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "docs" / "images" / "put-back.jpg")
    options = parser.parse_args()
    rows = [np.concatenate(_row(path, number), axis=1) for number, path in enumerate(options.sessions)]
    Image.fromarray(np.concatenate(rows)).save(options.output, quality=_QUALITY)
    print(f"{options.output} written")


def _row(path: Path, number: int) -> list[NDArray[np.uint8]]:
    """Return the photo of the session and its changes, each a cell."""
    face = faceposer.load(path)
    photo = face.session.document.photos[0]
    assert photo.camera is not None
    places = photo.camera.project(face.session.vertices.astype(np.float64))
    cells = [_cell(read_photo(Path(photo.path)), places)]
    for attributes, poses in _CHANGES:
        face = faceposer.load(path)
        if attributes:
            face.set_attributes(attributes)
        if poses[number]:
            face.apply_pose(poses[number])
        cells.append(_cell(face.put_back(), places))
    return cells


def _cell(picture: NDArray[np.uint8], places: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return the part of a ``picture`` around the head at ``places``, (N, 2)."""
    low, high = places.min(axis=0), places.max(axis=0)
    tall = _ROOM * float(high[1] - low[1])
    wide = tall * _WIDTH / _HEIGHT
    left, top = float(low[0] + high[0] - wide) / 2.0, float(low[1] + high[1]) / 2.0 - _MIDDLE * tall
    left, top = max(left, 0.0), max(top, 0.0)
    box = (left, top, min(left + wide, picture.shape[1]), min(top + tall, picture.shape[0]))
    part = Image.fromarray(picture).resize((_WIDTH, _HEIGHT), Image.Resampling.LANCZOS, box=box)
    return np.asarray(part)


if __name__ == "__main__":
    main()
