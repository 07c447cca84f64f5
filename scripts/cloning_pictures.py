#!/usr/bin/env python3
"""Draw the man's expressions on the goblin: by distances, and by key poses as they are and exaggerated.

python scripts/cloning_pictures.py                                     # docs/images/cloning.jpg
python scripts/cloning_pictures.py --compositions docs/images/cloning-keys.jpg
python scripts/cloning_pictures.py --film docs/images/cloning.webp --capture llv_dao.csv
"""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse
import sys
import tempfile
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.interchange.reading import read_performance
from faceposer.landmarks.drawing import draw
from faceposer.landmarks.painting import painted_character
from faceposer.model.face_model import FaceModel
from faceposer.poses.portrait import portrait_view
from faceposer.render.offscreen import render_character
from faceposer.resources import fonts_folder
from faceposer.session.key_compositions import folder_importance, importance_picture
from faceposer.session.key_proposals import create_keys
from faceposer.session.keys import load_keys
from faceposer.transfer.distances import DistanceTransfer
from faceposer.transfer.examples import ExampleTransfer, KeyPair
from faceposer.transfer.key_coverage import chosen_frames
from faceposer.transfer.key_models import composed, smoothed

Array = NDArray[np.float64]
IMAGE = ROOT / "docs" / "images" / "cloning.jpg"
# Strength of the exaggerated keys: the goblin's feelings, and its speech.
FEELING, SPEECH = 1.7, 1.25
FEELINGS = ("anger", "fear", "happiness", "sadness", "surprise")
# Pictures per second of the film; number of them from one emotion to the next and in it; sizes of both halves,
# and of the goblin in the sheet of expressions.
FILM_RATE, MOVING, HELD = 15.0, 6, 8
MAN, GOBLIN, SHEET = (240, 300), (410, 300), (380, 300)
QUALITY = 75
# Frames of the take that are keys.
ADDED = 2
SHOWN = (("happiness", 1.0), ("anger", 1.0), ("surprise", 1.0), ("sadness", 1.0))


def transfers(folder: Path) -> tuple[ExampleTransfer, ExampleTransfer, DistanceTransfer]:
    """Return the transfers from the man to the goblin by its keys, by exaggerated ones, and by distances."""
    plain = load_keys(create_keys(folder / "keys", "man", "creature")).transfer
    strong = [
        replace(pair, target=(FEELING if pair.name in FEELINGS else SPEECH) * pair.target) for pair in plain.pairs
    ]
    exaggerated = ExampleTransfer(plain.source, plain.target, strong)
    return plain, exaggerated, DistanceTransfer(plain.source, plain.target)


def portrait(
    model: FaceModel, pose: Array, size: tuple[int, int], zoom: float = 0.75, pan: float = 0.0
) -> NDArray[np.uint8]:
    """Return the picture of a pose; the goblin's ears need a smaller ``zoom`` and a ``pan`` to the middle."""
    view = portrait_view(model.character).zoomed(zoom).panned(pan, 0.0, size)
    return render_character(model.character, model.surface(pose), view.camera(size))


def sheet(folder: Path) -> Image.Image:
    """Return a row for each expression: the man, and the goblin by distances, by its keys, and exaggerated."""
    plain, exaggerated, distances = transfers(folder)
    named = {pair.name: pair.source for pair in plain.pairs}
    ah = next(source for name, source in named.items() if name == "ah")
    poses = [strength * named[name] for name, strength in SHOWN] + [0.6 * named["happiness"] + 0.7 * ah]
    rows = [
        [portrait(plain.source, pose, MAN, pan=-12.0)]
        + [portrait(plain.target, way.pose(pose), SHEET, 0.5, -20.0) for way in (distances, plain, exaggerated)]
        for pose in poses
    ]
    picture = np.concatenate([np.concatenate(row, axis=1) for row in rows])
    image = Image.new("RGB", (picture.shape[1], picture.shape[0] + 26), "white")
    image.paste(Image.fromarray(picture), (0, 26))
    pen = ImageDraw.Draw(image)
    font = ImageFont.truetype(str(next(fonts_folder().glob("*.ttf"))), 16)
    for i, title in enumerate(("man", "by distances", "by its keys", "keys exaggerated")):
        middle = MAN[0] // 2 if i == 0 else MAN[0] + (i - 1) * SHEET[0] + SHEET[0] // 2
        pen.text((middle, 13), title, fill="black", font=font, anchor="mm")
    return image


def compositions(folder: Path) -> Image.Image:
    """Return the importance of the man's vertices, and a composed key by the printed and by the smooth rule."""
    keys = create_keys(folder / "composed", "man", "man")
    found, character = folder_importance(keys, "source")
    loaded = load_keys(keys).transfer
    moved = {pair.name: loaded.source.instance(pair.source) - character.vertices for pair in loaded.pairs}
    top = importance_picture(character, [found.verbal_spread, found.emotional_spread, found.values], 420)
    camera = portrait_view(character).zoomed(1.5).camera((420, 420))
    smooth = smoothed(found.values, character.triangles)
    pictures = []
    for displacements in (
        moved["oh"],
        composed(moved["happiness"], moved["oh"], found.values, "switch", character.height),
        composed(moved["happiness"], moved["oh"], smooth, "smooth", character.height),
    ):
        mesh = painted_character(replace(character, textures={}), character.vertices + displacements)
        pictures.append(draw(mesh, camera).image)
    return Image.fromarray(np.concatenate([top, np.concatenate(pictures, axis=1)]))


def emotions(plain: ExampleTransfer) -> Array:
    """Return poses of the man that go from emotion to emotion and back to neutral, shape (F, r)."""
    named = {pair.name: pair.source for pair in plain.pairs}
    stations = [plain.source.neutral(), *(named[name] for name, _ in SHOWN), plain.source.neutral()]
    poses: list[Array] = [stations[0]] * (HELD // 2)
    for before, after in pairwise(stations):
        poses += [*between(before, after), *[after] * HELD]
    return np.array(poses[: len(poses) - HELD // 2])


def between(before: Array, after: Array) -> Array:
    """Return poses that go smoothly from one to another, the last one included, shape (MOVING, r)."""
    shares = (np.arange(MOVING) + 1.0) / MOVING
    return before + (shares * shares * (3.0 - 2.0 * shares))[:, None] * (after - before)


def film(folder: Path, path: Path, capture: Path) -> None:
    """Write emotions and a take of the man, and the goblin with exaggerated keys, as an animated picture."""
    plain, exaggerated, distances = transfers(folder)
    performance = read_performance(capture, plain.source).performance
    # No emotion closes one eye: the frames of the take that help most become keys, as by ``keys choose``.
    present = np.array([pair.source for pair in exaggerated.pairs])
    played = performance.coefficients
    helpful = [played[one.frame] for one in chosen_frames(plain.source, present, played, ADDED)]
    added = [KeyPair(f"frame {i}", pose, distances.pose(pose)) for i, pose in enumerate(helpful)]
    exaggerated = ExampleTransfer(plain.source, plain.target, [*exaggerated.pairs, *added])
    step = max(round(performance.rate / FILM_RATE), 1)
    begin = emotions(plain)
    end = between(played[::step][-1], begin[0])
    poses = np.concatenate([begin, played[::step], end])
    frames = []
    for pose in poses:
        man = portrait(plain.source, pose, MAN, pan=-12.0)
        goblin = portrait(plain.target, exaggerated.pose(pose), GOBLIN, 0.53, -22.0)
        frames.append(Image.fromarray(np.concatenate([man, goblin], axis=1)))
    settings: dict[str, Any] = {"quality": QUALITY, "method": 6} if path.suffix == ".webp" else {}
    duration = round(1000.0 / FILM_RATE)
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=duration, loop=0, **settings)


def main() -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=IMAGE, help="picture to write")
    parser.add_argument("--compositions", type=Path, metavar="FILE", help="write a picture of composed keys instead")
    parser.add_argument("--film", type=Path, metavar="FILE", help="write a film (.webp, .gif) instead")
    parser.add_argument("--capture", type=Path, metavar="CSV", help="take of the film")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if options.film is not None:
            film(folder, options.film, options.capture)
        elif options.compositions is not None:
            compositions(folder).save(options.compositions, quality=88)
        else:
            sheet(folder).save(options.output, quality=86)
    return 0


if __name__ == "__main__":
    sys.exit(main())
