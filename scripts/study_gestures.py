#!/usr/bin/env python3
"""Perform the gestures of an artist on every character and check the response of the face (docs/gestures.md).

    FACEPOSER_RIGS=FOLDER python scripts/study_gestures.py --json gestures.json --pictures FOLDER
    python scripts/study_gestures.py --characters man woman --gestures corners_up brow_up_left
    FACEPOSER_RIGS=FOLDER python scripts/study_gestures.py --docs            # docs/gestures.md and its images

FACEPOSER_RIGS is the folder with facecap.glb and facecap_multi.glb; without it the imported rigs are skipped.
"""

import argparse
import os
import sys
from pathlib import Path

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.errors import FacePoserError
from faceposer.evaluation.gestures.characters import CHARACTERS, RIGS
from faceposer.evaluation.gestures.hand import PriorSettings
from faceposer.evaluation.gestures.report import run, write_json, write_page
from faceposer.evaluation.gestures.table import BY_NAME
from faceposer.evaluation.gestures.tables import summary
from faceposer.solve.priors import PRIORS

PAGE = ROOT / "docs" / "gestures.md"


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--json", type=Path, help="file to write the rows to")
    parser.add_argument("--pictures", type=Path, help="folder for images before and after, and for the sheets")
    parser.add_argument("--docs", action="store_true", help="also write docs/gestures.md and its images")
    parser.add_argument("--characters", nargs="+", choices=CHARACTERS, help="default: all available")
    parser.add_argument("--gestures", nargs="+", choices=BY_NAME, metavar="GESTURE", help="default: all")
    parser.add_argument("--prior", choices=PRIORS, default=PriorSettings.prior)
    parser.add_argument("--prior-weight", type=float, default=PriorSettings.weight, metavar="WEIGHT")
    parser.add_argument("--spread", type=float, default=PriorSettings.spread, metavar="0-1")
    options = parser.parse_args()
    rigs = os.environ.get("FACEPOSER_RIGS")
    if options.docs and (options.characters or options.gestures or not rigs):
        parser.error("--docs covers everything: set FACEPOSER_RIGS, and omit --characters and --gestures")
    characters = options.characters or [name for name in CHARACTERS if rigs or name not in RIGS]
    gestures = [BY_NAME[name] for name in options.gestures or BY_NAME]
    settings = PriorSettings(options.prior, options.prior_weight, options.spread)
    try:
        sheets = PAGE.parent / "images" if options.docs else None
        rows = run(characters, gestures, settings, options.pictures, sheets, lambda line: print(line, file=sys.stderr))
        if options.json is not None:
            write_json(options.json, rows, settings)
        if options.docs:
            write_page(PAGE, rows, settings)
    except FacePoserError as error:
        raise SystemExit(f"study_gestures: {error}") from error
    print(summary(rows))


if __name__ == "__main__":
    main()
