"""Study heads and expressions from synthetic photos of people who are known (docs/photo-heads.md).

Run from the root of a checkout::

    python -m scripts.study_photo --json F.json --n 50 --views 1 3
    python -m scripts.study_photo --json F.json --n 10 --first 3000 --views 1 --lights other
    python -m scripts.study_photo --json F.json --n 10 --first 4000 --views 1 --lights other --paintings
    python -m scripts.study_photo --json F.json --n 6 --first 2000 --views 1 --likelihood 0.25
    python -m scripts.study_photo --json F.json --n 0 --scan shared/scans/perry_smith.obj
"""

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.files.writing import write_json
from scripts.photo_study.scan_photos import ScanStudy
from scripts.photo_study.study import Study, Trial, rows_of


def main() -> None:
    """Run the study; the file is written after each person, so that a run that is stopped leaves its results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, required=True, help="file of rows")
    parser.add_argument("--n", type=int, default=50, help="number of people")
    parser.add_argument("--first", type=int, default=0, help="number of the first person")
    parser.add_argument("--views", type=int, nargs="+", default=[1, 3], choices=(1, 2, 3), help="numbers of photos")
    parser.add_argument("--scan", help="also photos of this scan, OBJ with texture")
    parser.add_argument("--scan-photos", type=int, default=10, help="number of random photos of the scan")
    parser.add_argument("--add", type=Path, nargs="+", default=[], help="files of earlier runs, whose trials count")
    parser.add_argument(
        "--lights", choices=("phong", "other"), default="phong", help="light as of the fit, or lamps and sky"
    )
    parser.add_argument("--likelihood", type=float, default=1.0, help="weight of the density of heads")
    parser.add_argument("--paintings", action="store_true", help="make paintings of the photos, and fit them as such")
    options = parser.parse_args()
    study = Study(options.lights == "other", options.paintings, options.likelihood)
    trials = [trial for path in options.add for trial in _read(path)]
    if options.scan:
        scan = ScanStudy(study, options.scan)
        for number in range(options.scan_photos):
            found = list(scan.trials(number, options.views))
            trials += found
            _write(options.json, trials)
            print("scan", number, " ".join(f"{t.method}/{t.views} {t.head:.2f}" for t in found), flush=True)
    _write(options.json, trials)
    for number in range(options.first, options.first + options.n):
        found = list(study.trials(number, options.views))
        trials += found
        _write(options.json, trials)
        print(number, " ".join(f"{t.method}/{t.views} {t.head:.2f}|{t.expression:.2f}" for t in found), flush=True)


def _write(path: Path, trials: list[Trial]) -> None:
    write_json(path, {"rows": rows_of(trials), "trials": [asdict(trial) for trial in trials]}, "study")


def _read(path: Path) -> list[Trial]:
    return [Trial(**trial) for trial in json.loads(path.read_text(encoding="utf-8"))["trials"]]


if __name__ == "__main__":
    main()
