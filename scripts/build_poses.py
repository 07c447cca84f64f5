"""Build ``assets/poses``: seven expressions and thirteen visemes for the built-in characters.

Run from the root of a checkout::

    python -m scripts.build_poses             # poses for faces with ARKit's shapes, and for the goblin
    python -m scripts.build_poses --check     # compare with the committed files instead
    python -m scripts.build_poses --sheet docs/images/poses.jpg     # draw the existing poses on all faces

The goblin does not have ARKit's shapes: its poses are built from face units, as its examples are (this requires the
source data of ``build_assets.py``), and written as the nearest weights of its own shapes.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.api import characters, load
from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.poses.portrait import portrait_view
from faceposer.poses.pose_file import Pose, read_pose, write_pose
from faceposer.solve.weight_fit import fit_weights
from scripts.asset_building.builder import Builder
from scripts.asset_building.creature import build_creature
from scripts.asset_building.source import Source, download_wheel
from scripts.asset_building.starter_poses import STARTERS, Starter

#: Tolerance of the goblin's weights on another machine; its shapes have a size of some centimetres.
_TOLERANCE = 0.02
# Decimals: a thousandth of a shape is not visible.
_DECIMALS = 3
#: Width and height of an image of the sheet in pixels, and images per row.
_SIDE, _ACROSS = 140, 10


def people_poses() -> dict[str, Pose]:
    """Return the poses for all faces with ARKit's shapes by file name."""
    return {f"{one.stem}.json": _pose(one, one.sided(), "man") for one in STARTERS}


def creature_poses(builder: Builder) -> dict[str, Pose]:
    """Return the poses for the goblin by file name."""
    model = build_face_model(load_character("creature"))
    expressions = {one.stem: {**one.weights, **one.creature} for one in STARTERS}
    neutral, faces = build_creature(builder, expressions)
    poses = {}
    for one, vertices in zip(STARTERS, faces, strict=True):
        weights = _nearest(model, (vertices - neutral.vertices).astype(np.float64))
        poses[f"creature/{one.stem}.json"] = _pose(one, weights, "creature")
    return poses


def _nearest(model: FaceModel, offsets: NDArray[np.float64]) -> dict[str, float]:
    """Return the weights within their limits that best fit the ``offsets`` from neutral, shape (N, 3)."""
    shapes = model.character.shapes.reshape(len(model.character.shapes), -1).astype(np.float64)
    weights = np.linalg.solve(model.gram, shapes @ offsets.ravel())
    return fit_weights(model, model.coefficients_of(weights))


def _pose(one: Starter, weights: dict[str, float], character: str) -> Pose:
    rounded = {name: round(weight, _DECIMALS) for name, weight in weights.items()}
    return Pose(one.name, {name: weight for name, weight in rounded.items() if weight}, character, (one.tag,), one.note)


def differences(built: Pose, path: Path) -> str:
    """Return a description of the differences between ``built`` and the file ``path``, or ""."""
    if not path.is_file():
        return "is missing"
    stored = read_pose(path)
    if (built.name, built.character, built.tags, built.note) != (
        stored.name,
        stored.character,
        stored.tags,
        stored.note,
    ):
        return "differs in its words"
    names = built.weights.keys() | stored.weights.keys()
    far = max(abs(built.weights.get(name, 0.0) - stored.weights.get(name, 0.0)) for name in names)
    return f"differs by {far:.3f}" if far > _TOLERANCE else ""


def draw_sheet(path: Path) -> None:
    """Draw the poses on all built-in characters, two rows for each."""
    sheet = Image.new("RGB", (_ACROSS * _SIDE, 2 * len(characters()) * _SIDE))
    for i, character in enumerate(characters()):
        face = load(character)
        camera = portrait_view(face.character).camera((_SIDE, _SIDE))
        for k, one in enumerate(STARTERS):
            face.apply_pose(one.name)
            picture = Image.fromarray(face.render(view=camera))
            ImageDraw.Draw(picture).text((5, 3), one.name, fill="white")
            sheet.paste(picture, (k % _ACROSS * _SIDE, (2 * i + k // _ACROSS) * _SIDE))
    sheet.save(path, quality=88)
    print(f"{path}: {sheet.width} x {sheet.height}")


def main() -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--wheel", type=Path, help="source wheel, instead of a download")
    parser.add_argument("--cache", type=Path, default=ROOT / "build" / "source", help="folder for the download")
    parser.add_argument("--output", type=Path, default=ROOT / "assets" / "poses", help="output folder")
    parser.add_argument("--check", action="store_true", help="compare with the existing files instead of writing")
    parser.add_argument("--sheet", type=Path, metavar="FILE", help="only draw the existing poses to this file")
    options = parser.parse_args()
    if options.sheet is not None:
        draw_sheet(options.sheet)
        return 0
    builder = Builder(Source(options.wheel or download_wheel(options.cache)))
    poses = people_poses() | creature_poses(builder)
    n_different = 0
    for name, pose in poses.items():
        path = options.output / name
        if options.check:
            found = differences(pose, path)
            n_different += bool(found)
            print(f"{path}: {found or 'as built'}")
        else:
            write_pose(path, pose)
    if not options.check:
        print(f"{options.output}: {len(poses)} poses")
    return int(n_different > 0)


if __name__ == "__main__":
    sys.exit(main())
