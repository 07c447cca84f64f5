#!/usr/bin/env python3
"""Measure how well strokes without a source are recognised, and the faces that follow from them (docs/sketching.md).

    FACEPOSER_CAPTURES=FOLDER python scripts/study_sketching.py --json sketching.json
    FACEPOSER_CAPTURES=FOLDER python scripts/study_sketching.py --short --tune

Learned from take 3; strokes with the errors of a hand are drawn from poses of take 4 of the same performer, from the
front and from three quarters. With --tune, both are from take 3: the folds of docs/evaluation.md.
"""

import argparse
import os
import sys
from pathlib import Path
from typing import Any

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.errors import FacePoserError
from faceposer.evaluation.sketching.hand_errors import HandErrors
from faceposer.evaluation.sketching.report import confusion_of, reliability_of, study_rows, summary
from faceposer.evaluation.takes import Source
from faceposer.files.writing import write_json
from faceposer.training.expressions import Recipe

TRAIN, TEST = "alex_rom_3.csv", "alex_rom_4.csv"
POSES, SHORT_POSES = 30, 6


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--json", type=Path, help="file to write the rows and tables to")
    parser.add_argument("--short", action="store_true", help=f"{SHORT_POSES} poses instead of {POSES}")
    parser.add_argument("--poses", type=int, metavar="N", help=f"number of poses, {POSES} by default")
    parser.add_argument("--character", default="man", help="default: man")
    parser.add_argument("--training", type=int, nargs="+", default=[36, 300], help="numbers of training poses")
    parser.add_argument("--recognition", nargs="+", default=["paper", "ours"], choices=["paper", "ours"])
    parser.add_argument("--tune", action="store_true", help="learn from and test on the two folds of take 3")
    parser.add_argument("--coarse", action="store_true", help="hand errors of twice the size")
    parser.add_argument("--any-order", action="store_true", help="strokes in random order, not from above to below")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    folder = os.environ.get("FACEPOSER_CAPTURES")
    if not folder:
        parser.error(f"set FACEPOSER_CAPTURES to the folder with {TRAIN} and {TEST}")
    take, unseen = Path(folder) / TRAIN, Path(folder) / TEST
    count = options.poses or (SHORT_POSES if options.short else POSES)
    errors = HandErrors()
    if options.coarse:
        errors = HandErrors(jitter=2.0 * errors.jitter, shift=2.0 * errors.shift)
    results: list[dict[str, Any]] = []
    try:
        for fold in (1, 2) if options.tune else (None,):
            source = Source(options.character, (take,), () if options.tune else (unseen,), Recipe(), fold=fold)
            setting, frames = source.load()
            results += study_rows(
                setting,
                frames,
                count,
                options.training,
                options.recognition,
                errors,
                options.seed,
                _report,
                options.any_order,
            )
        document = {
            "learned_from": TRAIN,
            "tested_on": TRAIN if options.tune else TEST,
            "poses": count,
            "hand_errors": vars(errors),
            "any_order": options.any_order,
            "rows": [row for result in results for row in result["rows"]],
            "confusion": confusion_of(results),
            "reliability": reliability_of(results),
            "scribbles_accepted": [result["scribbles"] for result in results],
        }
        if options.json is not None:
            write_json(options.json, document, "study")
    except FacePoserError as error:
        raise SystemExit(f"study_sketching: {error}") from error
    print(summary(document))


def _report(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
