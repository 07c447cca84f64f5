"""Study expressions from synthetic films of people who are known, and steadiness (docs/film.md).

Run from the root of a checkout, with the folder of captures in FACEPOSER_CAPTURES::

    python -m scripts.study_film --json F.json --n 8 --photo astronaut.png
"""

import argparse
import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.files.writing import write_json
from scripts.film_study.study import Study, rows_of


def main() -> None:
    """Run the study; the file is written after each film, so that a run that is stopped leaves its results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, required=True, help="file of rows")
    parser.add_argument("--n", type=int, default=8, help="number of films")
    parser.add_argument("--fast", type=int, default=2, help="number of films of fast speech and blinks")
    parser.add_argument("--frames", type=int, default=60, help="frames of each film")
    parser.add_argument("--take", default="alex_rom_4.csv", help="capture whose motion the people have")
    parser.add_argument("--photo", type=Path, help="photo of 512 x 512 pixels over which a film pans, for steadiness")
    options = parser.parse_args()
    study, trials = Study(Path(os.environ["FACEPOSER_CAPTURES"]) / options.take, options.frames), []
    still = []
    if options.photo is not None:
        for row in study.steadiness(options.photo, options.frames):
            still.append(row)
            print(row, flush=True)
    for number in range(options.fast):
        for row in study.fast(number):
            still.append(row)
            print(row, flush=True)
    for number in range(options.n):
        found = list(study.trials(number, options.n))
        trials += found
        write_json(options.json, {"rows": rows_of(trials) + still}, "study")
        print(number, " ".join(f"{t.method} {t.errors.mean():.2f}|{t.jerk:.2f}" for t in found), flush=True)


if __name__ == "__main__":
    main()
