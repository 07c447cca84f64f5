#!/usr/bin/env python3
"""Draw figures 3, 4, 6, 8, 9 and 10 of Gunnarsson and Maddock (2010) with our heads (docs/sketching.md).

python scripts/sketching_figures.py                    # docs/images/sketching-*.jpg
python scripts/sketching_figures.py --only 6 8 -o FOLDER
"""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.animation.keyframes import Key, Keyframes
from faceposer.evaluation.sketching.artist import Artist
from faceposer.evaluation.sketching.hand_errors import HandErrors
from faceposer.geometry.camera import Camera
from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.feature_curves import FEATURES
from faceposer.model.framing import face_view
from faceposer.render.offscreen import render_character
from faceposer.resources import fonts_folder
from faceposer.session.sketching import library_poses, sketch_of
from faceposer.sketch.paper_recognition import PaperRecogniser
from faceposer.sketch.point_mixture import DEPTH_ERROR, Rays
from faceposer.sketch.polyline import evenly
from faceposer.sketch.recognition import DrawnStroke
from faceposer.sketch.sketcher import Sketcher
from faceposer.sketch.training_poses import FEW_POSES
from faceposer.sketch.visible_surface import VisibleSurface
from faceposer.solve.constraints.sketch import SketchConstraint
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import RECORDED_SPREAD, PoseProblem

FOLDER = ROOT / "docs" / "images"
Array = NDArray[np.float64]
SIDE = 340
# Poses of figure 10.
_STEPS = 12
INK, PAPER, RED, GREEN, BLUE, WHITE = (
    (227, 230, 232),
    (30, 31, 34),
    (235, 64, 52),
    (80, 200, 90),
    (70, 140, 250),
    (255,) * 3,
)
ANGER = {
    "browDownLeft": 0.9,
    "browDownRight": 0.9,
    "noseSneerLeft": 0.6,
    "noseSneerRight": 0.6,
    "eyeSquintLeft": 0.5,
    "eyeSquintRight": 0.5,
    "mouthFrownLeft": 0.5,
    "mouthFrownRight": 0.5,
    "mouthPressLeft": 0.4,
    "mouthPressRight": 0.4,
}
SMILE = {
    "mouthSmileLeft": 0.8,
    "mouthSmileRight": 0.8,
    "cheekSquintLeft": 0.5,
    "cheekSquintRight": 0.5,
    "jawOpen": 0.25,
}
#: Key poses of figure 9, and the features that are drawn for each.
KEYS: dict[str, tuple[dict[str, float], tuple[str, ...]]] = {
    "smile": (SMILE, ("outer upper lip", "outer lower lip", "left brow", "right brow")),
    "anger": (ANGER, ("left brow", "right brow", "left upper lid", "right upper lid", "mouth line")),
    "surprise": (
        {
            "jawOpen": 0.5,
            "browInnerUp": 0.9,
            "browOuterUpLeft": 0.8,
            "browOuterUpRight": 0.8,
            "eyeWideLeft": 0.7,
            "eyeWideRight": 0.7,
        },
        ("left brow", "right brow", "mouth outline", "left upper lid", "right upper lid"),
    ),
    "sadness": (
        {"browInnerUp": 0.9, "mouthFrownLeft": 0.9, "mouthFrownRight": 0.9, "mouthShrugLower": 0.4},
        ("left brow", "right brow", "mouth line", "outer lower lip"),
    ),
    "whistle": ({"mouthPucker": 0.9, "mouthFunnel": 0.3, "browInnerUp": 0.3}, ("outer upper lip", "outer lower lip")),
}


class Figures:
    """Pictures of one character."""

    def __init__(self, character: str) -> None:
        """Load the ``character``."""
        self.model: FaceModel = build_face_model(load_character(character))
        self.font = ImageFont.truetype(str(fonts_folder() / "Roboto/Roboto-Regular.ttf"), 17)

    @cached_property
    def sketcher(self) -> Sketcher:
        """Recognition and mapping, learned from 36 poses as in the paper."""
        return Sketcher(self.model, library_poses(self.model), FEW_POSES)

    def camera(self, view: str = "front", side: int = SIDE) -> Camera:
        """Return the camera of ``view`` for a square image."""
        return face_view(self.model.character, view).camera((side, side))

    def face(self, pose: Array, camera: Camera, title: str = "") -> Image.Image:
        """Return an image of ``pose`` with a ``title``."""
        image = Image.fromarray(render_character(self.model.character, self.model.surface(pose), camera))
        if title:
            ImageDraw.Draw(image).text((8, 6), title, INK, self.font)
        return image

    def artist(self, pose: Array, camera: Camera) -> Artist:
        """Return the artist who draws ``pose``."""
        return Artist(self.model.character, self.model.instance(pose), camera)

    def sketches(self, strokes: Sequence[DrawnStroke]) -> list[SketchConstraint]:
        """Return the constraints of ``strokes``, recognised one after the other."""
        found: list[SketchConstraint] = []
        others: list[DrawnStroke] = []
        pose = self.model.neutral()
        for stroke in strokes:
            best = self.sketcher.recognise(stroke, pose, others).best
            if best is None:
                continue
            others.append(DrawnStroke(stroke.pixels, stroke.camera, best.feature))
            found.append(sketch_of(stroke, best).resolved(self.model, pose))
            pose = self.solved(found)
        return found

    def solved(self, sketches: Sequence[SketchConstraint]) -> Array:
        """Return the pose of ``sketches`` by the MAP solve."""
        return solve(PoseProblem(self.model, list(sketches), spread=RECORDED_SPREAD)).coefficients

    def points(self, pose: Array) -> Array:
        """Return the positions of the feature points of training in a ``pose``, shape (F, 3)."""
        return self.sketcher.training.positions(pose)


def figure_3(figures: Figures) -> Image.Image:
    """Responsibilities of feature points for each point of a stroke along the outer upper lip."""
    camera = figures.camera(side=960)
    recogniser = figures.sketcher.recogniser("paper")
    assert isinstance(recogniser, PaperRecogniser)
    artist = figures.artist(figures.model.coefficients_of(SMILE), camera)
    true = artist.draw("outer upper lip", HandErrors(), np.random.default_rng(4))
    pixels = evenly(true.stroke.pixels, 32)
    rays = Rays.through(camera, pixels)
    height = figures.model.character.height
    surface = VisibleSurface(figures.model, figures.sketcher.training).under(camera, pixels, figures.model.neutral())
    joint = recogniser.mixture.log_joint(rays, surface, DEPTH_ERROR * height)
    shares = np.exp(joint - np.logaddexp.reduce(joint, axis=1)[:, None])
    names = recogniser.mixture.names
    cell, left, top = 22, 60, 30
    width, tall = left + cell * len(names), top + cell * 32 // 2 + 60
    image = Image.new("RGB", (width, tall), PAPER)
    draw = ImageDraw.Draw(image)
    small = ImageFont.truetype(str(fonts_folder() / "Roboto/Roboto-Regular.ttf"), 12)
    draw.text((8, 6), "feature point (right) of each point of the stroke (down)", INK, figures.font)
    for row, of_point in enumerate(shares):
        for column, share in enumerate(of_point):
            tone = int(255 * np.sqrt(share))
            x, y = left + cell * column, top + cell // 2 * row
            draw.rectangle((x, y, x + cell - 2, y + cell // 2 - 1), (tone, int(0.75 * tone), 60))
    for column, name in enumerate(names):
        draw.text((left + cell * column, tall - 50 + 16 * (column % 2)), name, INK, small)
    for row in (0, 15, 31):
        draw.text((left - 30, top + cell // 2 * row - 3), str(row + 1), INK, small)
    return image


def figure_4(figures: Figures) -> Image.Image:
    """Depth of a lip's points: that of the surface below the stroke, and that of the conditional Gaussian."""
    camera = figures.camera(side=960)
    lips = figures.model.instance(figures.model.neutral())[figures.model.character.feature_points["8.1"]]
    left = face_view(figures.model.character, "left")
    close = replace(left, target=(float(lips[0]), float(lips[1]), float(lips[2]) - 2.0), distance=left.distance / 3.0)
    side = close.camera((SIDE, SIDE))
    truth = figures.model.coefficients_of({"mouthPucker": 0.9, "mouthFunnel": 0.4})
    artist = figures.artist(truth, camera)
    true = artist.draw("outer upper lip", HandErrors(jitter=1.0, shift=0.0, length=0.02), np.random.default_rng(1))
    best = figures.sketcher.recognise(true.stroke, figures.model.neutral(), feature="outer upper lip").best
    assert best is not None
    pixels = np.array([point.pixel for point in best.points])
    below = VisibleSurface(figures.model, figures.sketcher.training).under(camera, pixels, figures.model.neutral())
    placed = figures.sketcher.paper.places_of([(camera, p.feature_point, p.pixel) for p in best.points])
    ids = [figures.model.character.feature_points[point.feature_point] for point in best.points]
    known = figures.model.instance(truth)[ids]
    front = figures.face(figures.model.neutral(), figures.camera(), "drawn")
    half = SIDE / 960
    ImageDraw.Draw(front).line([tuple(p) for p in (true.stroke.pixels * half).tolist()], WHITE, 2)
    images = [front]
    for title, places in (
        ("depth of the surface", below),
        ("conditional Gaussian", np.array([placed[point.feature_point] for point in best.points])),
    ):
        image = figures.face(truth, side, title)
        _marks(image, side.project(known), RED, cross=True)
        _marks(image, side.project(places[np.isfinite(places).all(axis=1)]), BLUE)
        images.append(image)
    return _row(images)


def figure_6(figures: Figures) -> Image.Image:
    """Completion of a pose of anger from the three points of one brow."""
    images = []
    pose = figures.model.coefficients_of(ANGER)
    points, names = figures.points(pose), figures.sketcher.training.names
    for view in ("front", "three-quarter"):
        camera = figures.camera(view)
        given = {name: points[names.index(name)] for name in FEATURES["left brow"].points}
        completed = figures.sketcher.paper.completed(given)
        image = figures.face(pose, camera)
        _marks(image, camera.project(points), RED, cross=True)
        _marks(image, camera.project(completed), BLUE)
        _marks(image, camera.project(np.array(list(given.values()))), GREEN, radius=6)
        images.append(image)
    return _row(images)


def figure_8(figures: Figures) -> Image.Image:
    """The face mapped from all feature points of a pose of anger."""
    pose = figures.model.coefficients_of(ANGER)
    mapped = figures.sketcher.paper.face_of(figures.points(pose))
    error = np.linalg.norm(figures.model.instance(mapped) - figures.model.instance(pose), axis=1).mean()
    camera = figures.camera()
    given = figures.face(pose, camera, "the pose")
    _marks(given, camera.project(figures.points(pose)), RED, cross=True)
    return _row([given, figures.face(mapped, camera, f"from its feature points: {10.0 * error:.2f} mm")])


def figure_9(figures: Figures) -> Image.Image:
    """Key poses that are drawn: the strokes, and the face by both methods."""
    camera, wide = figures.camera(), figures.camera(side=960)
    rows = []
    for number, (name, (weights, features)) in enumerate(KEYS.items()):
        artist = figures.artist(figures.model.coefficients_of(weights), wide)
        rng = np.random.default_rng(number)
        strokes = [artist.draw(feature, HandErrors(), rng).stroke for feature in features if feature in artist.lines]
        drawn = figures.face(figures.model.neutral(), camera, name)
        for stroke in strokes:
            line = [tuple(p) for p in (stroke.pixels * SIDE / 960).tolist()]
            ImageDraw.Draw(drawn).line(line, WHITE, 3, joint="curve")
        unnamed = [DrawnStroke(stroke.pixels, stroke.camera) for stroke in strokes]
        sketches = figures.sketches(unnamed)
        mapped = figures.sketcher.paper_pose(sketches, figures.model.neutral())
        titles = ("", "MAP solve", "the paper's mapping") if not number else ("", "", "")
        rows.append(
            [
                drawn,
                figures.face(figures.solved(sketches), camera, titles[1]),
                figures.face(mapped, camera, titles[2]),
            ]
        )
    return _column([_row(row) for row in rows])


def figure_10(figures: Figures) -> Image.Image:
    """Two keys and ten poses between them, from splines through the feature points, as the timeline has them."""
    small = figures.camera(side=220)
    keys = tuple(
        Key.of(frame, figures.model.coefficients_of(weights)) for frame, weights in ((0, SMILE), (_STEPS - 1, ANGER))
    )
    poses = Keyframes(keys, length=_STEPS, inbetweens="feature points").sampled(figures.model, np.arange(_STEPS))
    images = [figures.face(pose, small) for pose in poses]
    return _column([_row(images[:6]), _row(images[6:])])


FIGURES: dict[int, Callable[[Figures], Image.Image]] = {
    3: figure_3,
    4: figure_4,
    6: figure_6,
    8: figure_8,
    9: figure_9,
    10: figure_10,
}


def _marks(image: Image.Image, pixels: Array, colour: tuple[int, ...], radius: int = 4, cross: bool = False) -> None:
    draw = ImageDraw.Draw(image)
    for x, y in pixels.tolist():
        if cross:
            draw.line((x - 3, y - 3, x + 3, y + 3), colour, 2)
            draw.line((x - 3, y + 3, x + 3, y - 3), colour, 2)
        else:
            draw.ellipse((x - radius, y - radius, x + radius, y + radius), outline=colour, width=2)


def _row(images: Sequence[Image.Image]) -> Image.Image:
    row = Image.new("RGB", (sum(image.width for image in images), max(image.height for image in images)), PAPER)
    left = 0
    for image in images:
        row.paste(image, (left, 0))
        left += image.width
    return row


def _column(images: Sequence[Image.Image]) -> Image.Image:
    column = Image.new("RGB", (max(image.width for image in images), sum(image.height for image in images)), PAPER)
    top = 0
    for image in images:
        column.paste(image, (0, top))
        top += image.height
    return column


def main() -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=FOLDER, help="folder to write the images to")
    parser.add_argument("--only", type=int, nargs="+", choices=tuple(FIGURES), default=list(FIGURES))
    parser.add_argument("--character", default="man", help="default: man")
    options = parser.parse_args()
    figures = Figures(options.character)
    for number in options.only:
        path = options.output / f"sketching-{number}.jpg"
        FIGURES[number](figures).save(path, quality=82)
        print(f"{path} written")
    return 0


if __name__ == "__main__":
    sys.exit(main())
