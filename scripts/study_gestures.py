#!/usr/bin/env python3
"""Make an artist's gestures on every character and judge what the face does (docs/gestures.md).

    FACEPOSER_RIGS=FOLDER python scripts/study_gestures.py --json gestures.json --pictures FOLDER
    python scripts/study_gestures.py --characters man woman --gestures corners_up brow_up_left
    FACEPOSER_RIGS=FOLDER python scripts/study_gestures.py --docs            # docs/gestures.md and its pictures

Without FACEPOSER_RIGS, which names the folder of facecap.glb and facecap_multi.glb, the imported rigs are left out.
"""

import argparse
import json
import os
import sys
from pathlib import Path

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.evaluation.gestures.characters import CHARACTERS, RIGS, load_character
from faceposer.evaluation.gestures.hand import PriorSettings
from faceposer.evaluation.gestures.rows import study
from faceposer.evaluation.gestures.table import BY_NAME
from faceposer.evaluation.gestures.tables import summary
from faceposer.solve.priors import PRIORS


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--json", type=Path, help="file for the rows")
    parser.add_argument("--characters", nargs="+", choices=CHARACTERS, help="default: all that there are")
    parser.add_argument("--gestures", nargs="+", choices=BY_NAME, metavar="GESTURE", help="default: all")
    parser.add_argument("--prior", choices=PRIORS, default=PriorSettings.prior)
    parser.add_argument("--prior-weight", type=float, default=PriorSettings.weight)
    options = parser.parse_args()
    rigs = os.environ.get("FACEPOSER_RIGS")
    chosen = options.characters or [name for name in CHARACTERS if rigs or name not in RIGS]
    settings = PriorSettings(options.prior, options.prior_weight)
    gestures = [BY_NAME[name] for name in options.gestures or BY_NAME]
    rows = []
    for character in chosen:
        model = load_character(character)
        for _, row in study(character, model, gestures, settings):
            rows.append(row)
        print(f"{character} done", file=sys.stderr)
    if options.json is not None:
        content = {"prior": settings.prior, "prior_weight": settings.weight, "rows": rows}
        options.json.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    print(summary(rows))


if __name__ == "__main__":
    main()
