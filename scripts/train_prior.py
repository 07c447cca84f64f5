#!/usr/bin/env python3
"""Learn the built-in statistics of expressions, assets/expressions.npz, from real captures.

    FACEPOSER_CAPTURES=FOLDER python scripts/train_prior.py            # learn and write
    FACEPOSER_CAPTURES=FOLDER python scripts/train_prior.py --check    # learn and compare with the existing file

Of the first performer only take 3 is used, so that take 4 remains for tests. A quarter of the examples is made from
takes of two other performers; the evaluation leaves out whole performers to measure learning without them
(docs/evaluation.md).
"""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    # One thread gives the same sums on every machine.
    os.environ[variable] = "1"

import argparse
import sys
import time
from pathlib import Path

import numpy as np

from faceposer.evaluation.takes import steady
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.character_file import load_character
from faceposer.model.expression_statistics import load_expression_statistics
from faceposer.model.face_model import gram_of_weights
from faceposer.resources import asset_path
from faceposer.training.capture import read_capture
from faceposer.training.expressions import Recipe, learn

TAKE = "alex_rom_3.csv"
OTHERS = ("jmtechart_myslate_3.csv", "llv_dao.csv")
CREDITS = (
    "Learned from facial captures (c) 2021 Alexandre Donciu-Julin and (c) 2023 JMTechArt, MIT licence, and (c) 2021 "
    "blurryroots innovation qanat OUe, BSD 2-clause licence; see assets/README.md."
)
TOLERANCE = 1e-3


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="compare with the committed file instead of writing it")
    options = parser.parse_args()
    folder = os.environ.get("FACEPOSER_CAPTURES")
    if not folder:
        sys.exit("Set FACEPOSER_CAPTURES to the folder with the capture files.")
    began = time.perf_counter()
    # Correlations between regions are weighted by their visible effect on an ordinary face, the man's.
    metric = gram_of_weights(load_character("man"), ARKIT_SHAPES)
    statistics = learn(
        [read_capture(Path(folder) / TAKE)],
        credits=CREDITS,
        metric=metric,
        others=[[steady(Path(folder) / name, Recipe().jump)] for name in OTHERS],
    )
    print(f"learned from {', '.join((TAKE, *OTHERS))} in {time.perf_counter() - began:.1f} s")
    path = asset_path("expressions.npz")
    if not options.check:
        statistics.save(path)
        print(f"{path} written, {path.stat().st_size / 1024:.0f} kB")
        return
    committed = load_expression_statistics(path)
    for name in ("weights", "means", "covariances", "mean", "covariance", "coupling", "examples"):
        difference = float(np.abs(getattr(statistics, name) - getattr(committed, name)).max())
        print(f"{name}: largest difference {difference:.2g}")
        if difference > TOLERANCE:
            sys.exit(f"{path} does not match this recipe: {name} differs by {difference:.2g}.")
    if statistics.regions != committed.regions:
        sys.exit(f"{path} does not match this recipe: the regions differ.")
    print("as committed")


if __name__ == "__main__":
    main()
