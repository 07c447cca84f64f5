#!/usr/bin/env python3
"""Draw a sheet of faces posed by the drawings in docs/drawings: each drawing beside the man, the woman and the goblin.

python scripts/drawing_gallery.py                 # docs/images/drawings.jpg
python scripts/drawing_gallery.py --relative off -o off.jpg
"""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse
import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

import faceposer
from faceposer.errors import FacePoserError
from faceposer.model.framing import face_view
from faceposer.resources import fonts_folder
from faceposer.session.drawings import summary
from faceposer.sketch.svg_file import read_svg

IMAGE = ROOT / "docs" / "images" / "drawings.jpg"
FOLDER = ROOT / "docs" / "drawings"
NAMES = ("joy", "sadness", "anger", "surprise", "disgust", "smirk")
CHARACTERS = ("man", "woman", "creature")
_TILE, _PER_ROW, _FACTOR, _MARGIN = 260, 2, 3, 0.06
_PAPER, _INK = (250, 248, 242), (40, 40, 50)


def picture_of(path: Path, size: int) -> Image.Image:
    """Return the lines of the drawing ``path`` on a square of ``size`` pixels."""
    lines = [stroke.points for stroke in read_svg(path).strokes if not stroke.neutral]
    points = np.concatenate(lines)
    low, high = points.min(axis=0), points.max(axis=0)
    whole = size * _FACTOR
    scale = (1.0 - 2.0 * _MARGIN) * whole / float((high - low).max())
    image = Image.new("RGB", (whole, whole), _PAPER)
    draw = ImageDraw.Draw(image)
    for line in lines:
        placed = (line - 0.5 * (low + high)) * scale + 0.5 * whole
        draw.line([(float(x), float(y)) for x, y in placed], fill=_INK, width=2 * _FACTOR, joint="curve")
    return image.resize((size, size), Image.Resampling.LANCZOS)


def main() -> None:
    """Parse the command line and write the sheet."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=IMAGE, help="image to write (default: %(default)s)")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="folder of the drawings (default: %(default)s)")
    parser.add_argument("--names", nargs="+", default=list(NAMES), metavar="NAME", help="drawings, without .svg")
    parser.add_argument("--relative", default="auto", help="as in faceposer sketch")
    parser.add_argument("--tile", type=int, default=_TILE, help="side of a tile in pixels (default: %(default)s)")
    options = parser.parse_args()
    tile, names = options.tile, options.names
    columns = len(CHARACTERS) + 1
    rows = -(-len(names) // _PER_ROW)
    sheet = Image.new("RGB", (tile * columns * _PER_ROW, tile * rows), _PAPER)
    font = ImageFont.truetype(str(next(iter(sorted(fonts_folder().glob("*.ttf"))))), 15)
    draw = ImageDraw.Draw(sheet)
    for c, character in enumerate(CHARACTERS):
        for i, name in enumerate(names):
            face = faceposer.load(character)
            path = options.folder / f"{name}.svg"
            found = face.sketch_drawing(path, relative=options.relative)
            face.solve()
            if c == 0:
                print(f"{name}: {summary(found)}.")
            camera = face_view(face.character).zoomed(1.08).camera((2 * tile, 2 * tile))
            image = Image.fromarray(face.render(view=camera)[..., :3]).resize((tile, tile), Image.Resampling.LANCZOS)
            left, top = (i % _PER_ROW) * columns * tile, (i // _PER_ROW) * tile
            sheet.paste(image, (left + (c + 1) * tile, top))
            if c == 0:
                sheet.paste(picture_of(path, tile), (left, top))
                draw.text((left + 8, top + 6), name, fill=_INK, font=font)
    sheet.save(options.output, quality=88)
    print(f"{options.output} written")


if __name__ == "__main__":
    try:
        main()
    except FacePoserError as error:
        sys.exit(f"drawing_gallery.py: {error}")
