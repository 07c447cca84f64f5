#!/usr/bin/env python3
"""Make the film of docs/animation.md: four drawn expressions become the keys of a loop.

    python scripts/sketched_animation.py                                # docs/images/sketched-animation.webp
    python scripts/sketched_animation.py -o four.gif --inbetweens poses # one way to the frames between keys alone

Each expression is drawn in at most six strokes on the neutral face, whose features are recognised, and becomes a key.
The film shows the motion with both kinds of in-betweens side by side, and the strokes as each key is passed. The script
fails if a stroke is taken for another feature than the one that was meant, or the file is larger than 1.5 MB.
"""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from scipy.interpolate import CubicSpline

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

import faceposer
from faceposer.animation.keyframes import INBETWEENS
from faceposer.api.face import Face
from faceposer.geometry.camera import Camera
from faceposer.geometry.mesh import VertexNormals
from faceposer.model.feature_curves import FEATURES
from faceposer.model.performance import Performance
from faceposer.render.framebuffers import ColourTarget
from faceposer.render.offscreen import offscreen_context
from faceposer.render.renderer import Renderer
from faceposer.resources import fonts_folder
from faceposer.sketch.inbetweens import Inbetweens

Array = np.ndarray
Offsets = Sequence[tuple[float, float]]


@dataclass(frozen=True)
class Drawing:
    """An expression as strokes on the neutral face.

    Attributes:
        name: Name of the expression.
        strokes: For each feature, the offsets of its feature points in hundredths of the distance of the outer corners
            of the eyes, to the right and down in the image.
    """

    name: str
    strokes: Mapping[str, Offsets]


def both(name: str, right: Offsets) -> dict[str, Offsets]:
    """Return the strokes of the right and the left feature ``name``, given the right one."""
    return {f"right {name}": right, f"left {name}": [(-x, y) for x, y in right]}


DRAWINGS = (
    Drawing(
        "Joy",
        {
            **both("brow", [(0, -3), (-1, -4), (-1, -3)]),
            "outer lower lip": [(-7, -8), (-4, 0), (0, 3), (4, 0), (7, -8)],
            "outer upper lip": [(-7, -8), (-4, -4), (-1, -1), (0, 0), (1, -1), (4, -4), (7, -8)],
            **both("lower lid", [(0, 0), (0, -1.5), (0, 0)]),
        },
    ),
    Drawing(
        "Surprise",
        {
            **both("brow", [(0, -11), (-1, -12), (-1, -9)]),
            **both("upper lid", [(0, 0), (0, -3.5), (0, 0)]),
            "outer upper lip": [(2, 4), (1, 0), (0, -1), (0, -1), (0, -1), (-1, 0), (-2, 4)],
            "outer lower lip": [(2, 4), (1, 15), (0, 19), (-1, 15), (-2, 4)],
        },
    ),
    Drawing(
        "Anger",
        {
            **both("brow", [(3, 8), (1, 4), (0, 1)]),
            **both("upper lid", [(0, 0), (0, 3), (0, 1)]),
            "outer upper lip": [(1, 4), (0, 2), (0, 1), (0, 1), (0, 1), (0, 2), (-1, 4)],
            "outer lower lip": [(1, 4), (0, -1), (0, -2), (0, -1), (-1, 4)],
        },
    ),
    Drawing(
        "Sadness",
        {
            **both("brow", [(2, -8), (0, -1), (0, 3)]),
            **both("upper lid", [(0, 0), (0, 2.5), (0, 0)]),
            "outer upper lip": [(-1, 7), (0, 2), (0, -1), (0, -1), (0, -1), (0, 2), (1, 7)],
            "outer lower lip": [(-1, 7), (0, 2), (0, -1), (0, 2), (1, 7)],
        },
    ),
)

RATE, SPACING = 24.0, 20
FACE, SMALL = (340, 400), (164, 193)
MARGIN, BAR = 8, 26
QUALITY, MAX_BYTES = 72, 1_500_000
# Frames over which the strokes of a key fade in and out.
_FADE = 7
_INK, _PAPER, _ACCENT = (236, 238, 242), (24, 26, 30), (255, 176, 59)
_TITLES: dict[Inbetweens, str] = {"poses": "In-betweens: poses", "feature points": "In-betweens: feature points"}


def hand_line(camera: Camera, face: Face, feature: str, offsets: Offsets) -> Array:
    """Return the pixels, shape (40, 2), of a stroke through the moved feature points of the neutral face."""
    neutral = face.character.vertices
    ids = face.character.feature_points
    (chain,) = FEATURES[feature].chains
    corners = camera.project(neutral[[ids["3.12"], ids["3.7"]]])
    unit = float(np.hypot(*(corners[1] - corners[0]))) / 100.0
    points = camera.project(neutral[[ids[name] for name in chain]]) + unit * np.array(offsets)
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    return np.asarray(CubicSpline(lengths, points)(np.linspace(0.0, lengths[-1], 40)))


def drawn_keys(face: Face, camera: Camera) -> list[dict[str, Array]]:
    """Draw all expressions on ``face`` and set a key for each; return the strokes by feature.

    Exits with an error if a stroke is recognised as another feature.
    """
    drawn = []
    for i, drawing in enumerate(DRAWINGS):
        face.reset()
        lines = {}
        for feature, offsets in drawing.strokes.items():
            lines[feature] = hand_line(camera, face, feature, offsets)
            best = face.sketch(lines[feature], camera=camera).best
            # The next stroke is recognised on the face that follows this one.
            face.solve()
            if best is None or best.feature != feature:
                sys.exit(f"{drawing.name}: the {feature} was taken for {best.feature if best else 'no feature'}.")
            print(f"{drawing.name}: {feature}, {100.0 * best.probability:.0f} %")
        face.set_key(i * SPACING)
        drawn.append(lines)
    face.set_animation(length=len(DRAWINGS) * SPACING, rate=RATE, loop=True)
    return drawn


class Pictures:
    """Pictures of a face, rendered at twice their size.

    The strokes are shown where they were drawn.
    """

    def __init__(self, renderer: Renderer, target: ColourTarget, face: Face, camera: Camera) -> None:
        """Render ``face`` as ``camera`` sees it."""
        self._renderer, self._target, self._face, self._camera = renderer, target, face, camera
        self._normals = VertexNormals(face.character.triangles, len(face.character.vertices))

    @classmethod
    @contextmanager
    def rendering(cls, face: Face, camera: Camera) -> Iterator["Pictures"]:
        """Yield the pictures of ``face`` while there is an OpenGL context."""
        with offscreen_context() as ctx:
            renderer = Renderer(ctx)
            renderer.set_character(face.character)
            target = ColourTarget(ctx, camera.size, min(4, ctx.max_samples))
            yield cls(renderer, target, face, camera)
            target.release()
            renderer.release()

    def of(self, pose: Array, lines: Mapping[str, Array], opacity: float, size: tuple[int, int]) -> Image.Image:
        """Return the picture of ``pose``, shape (r,), with strokes of some opacity."""
        vertices = np.ascontiguousarray(self._face.model.surface(pose), dtype=np.float32)
        self._renderer.update(vertices, self._normals(vertices))
        self._renderer.draw(self._target.framebuffer, self._camera)
        self._target.resolve()
        picture = Image.fromarray(self._target.read())
        if opacity > 0.0:
            strokes = Image.new("L", picture.size, 0)
            draw = ImageDraw.Draw(strokes)
            for line in lines.values():
                draw.line([tuple(point) for point in line.tolist()], fill=round(255 * opacity), width=5, joint="curve")
            picture.paste(Image.new("RGB", picture.size, _ACCENT), mask=strokes)
        return picture.resize(size, Image.Resampling.LANCZOS)


def film(face: Face, camera: Camera, drawn: list[dict[str, Array]], kinds: Sequence[Inbetweens]) -> list[Image.Image]:
    """Return the frames of the film: a column for each of ``kinds``, and the drawings below."""
    performances: list[Performance] = []
    for kind in kinds:
        face.set_animation(inbetweens=kind)
        assert face.performance is not None
        performances.append(face.performance)
    length = len(performances[0])
    width = max(len(kinds) * (FACE[0] + MARGIN) + MARGIN, len(drawn) * (SMALL[0] + MARGIN) + MARGIN)
    left = (width - len(kinds) * (FACE[0] + MARGIN) + MARGIN) // 2
    font = ImageFont.truetype(str(fonts_folder() / "Roboto/Roboto-Regular.ttf"), 16)
    images = []
    with Pictures.rendering(face, camera) as pictures:
        first = performances[0]
        small = [pictures.of(first.coefficients[i * SPACING], lines, 1.0, SMALL) for i, lines in enumerate(drawn)]
        for frame in range(length):
            sheet = Image.new("RGB", (width, BAR + FACE[1] + BAR + SMALL[1] + MARGIN), _PAPER)
            draw = ImageDraw.Draw(sheet)
            near = round(frame / SPACING) % len(drawn)
            away = abs(frame - near * SPACING)
            shown = max(1.0 - min(away, length - away) / _FADE, 0.0)
            for column, (kind, performance) in enumerate(zip(kinds, performances, strict=True)):
                x = left + column * (FACE[0] + MARGIN)
                sheet.paste(pictures.of(performance.coefficients[frame], drawn[near], shown, FACE), (x, BAR))
                draw.text((x + FACE[0] // 2, BAR // 2), _TITLES[kind], _INK, font, anchor="mm")
            _draw_strip(sheet, small, near, shown, font)
            images.append(sheet)
    return images


def _draw_strip(
    sheet: Image.Image, small: list[Image.Image], near: int, shown: float, font: ImageFont.FreeTypeFont
) -> None:
    """Draw the keys with their strokes, and a border around the one that is ``near``."""
    draw = ImageDraw.Draw(sheet)
    top = BAR + FACE[1] + BAR
    left = (sheet.width - len(small) * (SMALL[0] + MARGIN) + MARGIN) // 2
    for i, (picture, drawing) in enumerate(zip(small, DRAWINGS, strict=True)):
        x = left + i * (SMALL[0] + MARGIN)
        sheet.paste(picture, (x, top))
        draw.text((x + SMALL[0] // 2, top - BAR // 2), drawing.name, _INK, font, anchor="mm")
        if i == near and shown > 0.0:
            border = [round(paper + shown * (ink - paper)) for paper, ink in zip(_PAPER, _ACCENT, strict=True)]
            draw.rectangle((x - 3, top - 3, x + SMALL[0] + 2, top + SMALL[1] + 2), outline=tuple(border), width=3)


def main() -> None:
    """Make the film."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = ROOT / "docs" / "images" / "sketched-animation.webp"
    parser.add_argument("-o", "--output", type=Path, default=default, help="file to write (default: %(default)s)")
    parser.add_argument("--character", default="man", help="name or file of a character (default: man)")
    parser.add_argument("--inbetweens", choices=INBETWEENS, help="show one kind of in-betweens (default: both)")
    parser.add_argument("--session", type=Path, help="also save the session")
    options = parser.parse_args()
    face = faceposer.load(options.character)
    camera = face.camera("front", (2 * FACE[0], 2 * FACE[1]))
    drawn = drawn_keys(face, camera)
    if options.session is not None:
        face.save(options.session)
    kinds = INBETWEENS if options.inbetweens is None else (options.inbetweens,)
    first, *others = film(face, camera, drawn, kinds)
    settings = {"quality": QUALITY, "method": 6} if options.output.suffix == ".webp" else {}
    first.save(options.output, save_all=True, append_images=others, duration=round(1000.0 / RATE), loop=0, **settings)
    size = options.output.stat().st_size
    print(f"{options.output}: {1 + len(others)} frames, {(1 + len(others)) / RATE:.1f} s, {size / 1e6:.2f} MB")
    if size > MAX_BYTES:
        sys.exit(f"{options.output} is larger than {MAX_BYTES / 1e6:.1f} MB; lower QUALITY or FACE.")


if __name__ == "__main__":
    main()
