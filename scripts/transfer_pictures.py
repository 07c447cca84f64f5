#!/usr/bin/env python3
"""Draw a sheet of expressions of the man transferred to the other characters, by distances and by ARKit's weights.

python scripts/transfer_pictures.py                       # docs/images/transfer.jpg
python scripts/transfer_pictures.py --pairs paper -o three.jpg
"""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import OrbitView
from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.render.offscreen import render_character
from faceposer.resources import fonts_folder
from faceposer.transfer.pairs import PRESETS, Pair
from faceposer.transfer.transfer import make_transfer

IMAGE = ROOT / "docs" / "images" / "transfer.jpg"
EXPRESSIONS: dict[str, dict[str, float]] = {
    "smile": {
        "mouthSmileLeft": 1.0,
        "mouthSmileRight": 1.0,
        "cheekSquintLeft": 0.7,
        "cheekSquintRight": 0.7,
        "eyeSquintLeft": 0.4,
        "eyeSquintRight": 0.4,
        "mouthUpperUpLeft": 0.25,
        "mouthUpperUpRight": 0.25,
        "jawOpen": 0.08,
    },
    "frown": {
        "mouthFrownLeft": 0.8,
        "mouthFrownRight": 0.8,
        "mouthShrugLower": 0.5,
        "browDownLeft": 0.8,
        "browDownRight": 0.8,
        "mouthPressLeft": 0.3,
        "mouthPressRight": 0.3,
    },
    "surprise": {
        "jawOpen": 0.5,
        "mouthFunnel": 0.2,
        "browInnerUp": 0.9,
        "browOuterUpLeft": 0.9,
        "browOuterUpRight": 0.9,
        "eyeWideLeft": 0.8,
        "eyeWideRight": 0.8,
    },
    "wink": {
        "eyeBlinkLeft": 1.0,
        "cheekSquintLeft": 0.6,
        "mouthSmileLeft": 0.7,
        "mouthDimpleLeft": 0.3,
        "browDownLeft": 0.3,
        "eyeLookOutLeft": 0.2,
        "eyeLookInRight": 0.2,
    },
}
TARGETS = ("woman", "creature", "low")
SIDE = 300


def pictures(pairs: tuple[Pair, ...]) -> list[list[NDArray[np.uint8] | None]]:
    """Return a row of images for each expression: the man's, then each target's by distances and by weights."""
    models = {name: build_face_model(load_character(name)) for name in ("man", *TARGETS)}
    man = models["man"]
    rows: list[list[NDArray[np.uint8] | None]] = []
    for weights in EXPRESSIONS.values():
        pose = man.coefficients_of(weights)
        row: list[NDArray[np.uint8] | None] = [_picture(man, pose)]
        for method in ("distances", "weights"):
            for name in TARGETS:
                try:
                    transfer = make_transfer(man, models[name], method, pairs)  # type: ignore[arg-type]
                except FacePoserError:
                    row.append(None)
                    continue
                row.append(_picture(models[name], transfer.pose(pose)))
        rows.append(row)
    return rows


def _picture(model: FaceModel, pose: NDArray[np.float64]) -> NDArray[np.uint8]:
    character = model.character
    skin = character.vertices[list(character.feature_points.values())]
    low, high = skin.min(axis=0), skin.max(axis=0)
    return render_character(character, model.instance(pose), OrbitView.preset(low, high).camera((SIDE, SIDE)))


def sheet(rows: list[list[NDArray[np.uint8] | None]]) -> Image.Image:
    """Return the sheet with its captions."""
    titles = ["man", *(f"{name}, {way}" for way in ("by distances", "by weights") for name in TARGETS)]
    top, left = 34, 96
    image = Image.new("RGB", (left + len(titles) * SIDE, top + len(rows) * SIDE), (30, 31, 34))
    draw = ImageDraw.Draw(image)
    font = ImageFont.truetype(str(fonts_folder() / "Roboto/Roboto-Regular.ttf"), 20)
    for column, title in enumerate(titles):
        draw.text((left + (column + 0.5) * SIDE, top / 2), title, (227, 230, 232), font, anchor="mm")
    for index, (name, row) in enumerate(zip(EXPRESSIONS, rows, strict=True)):
        draw.text((left / 2, top + (index + 0.5) * SIDE), name, (227, 230, 232), font, anchor="mm")
        for column, picture in enumerate(row):
            place = (left + column * SIDE, top + index * SIDE)
            if picture is None:
                middle = (place[0] + SIDE / 2, place[1] + SIDE / 2)
                draw.text(middle, "has none of\nARKit's shapes", (148, 153, 160), font, anchor="mm", align="center")
            else:
                image.paste(Image.fromarray(picture), place)
    return image


def main() -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=IMAGE, help="image to write")
    parser.add_argument("--pairs", choices=tuple(PRESETS), default="full", help="pairs of distances")
    options = parser.parse_args()
    sheet(pictures(PRESETS[options.pairs])).save(options.output, quality=88)
    print(f"{options.output} written")
    return 0


if __name__ == "__main__":
    sys.exit(main())
