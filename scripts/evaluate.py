#!/usr/bin/env python3
"""Compare priors by how near they come to expressions that they have never seen.

    FACEPOSER_CAPTURES=FOLDER python scripts/evaluate.py --json evaluation.json

Trained on take 3, tested on take 4 (section 9 of the paper): from the neutral face, random visible points that move are
given the pixels that they have in an unseen frame, exactly or with the 1.5 px by which a hand misses; the pose found
is compared with the frame. All methods see the same constraints under the same camera and run the same solver.

  mfa        what ships: a mixture for each region seen from the start pose, coupled as the data says, weights bounded
  mfa-whole  the same with one mixture over the whole face, which the program offers too
  mfa-plain  mixture by plain maximum likelihood, K = 30, q = 10, as in the paper: its modes are where they are
  ppca       one Gaussian, same examples and subspace
  pca        no prior, in the subspace of 99 % of the variance, which suits it best
  mfa-paper  mfa-plain as the paper has it: raw frames, subspace of 99 % of the variance (for comparison)

Then all points of a trial lie in one region, and what the two priors that ship do to the other regions is measured.
"""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse
import json
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.geometry.camera import Camera, OrbitView
from faceposer.model.expression_statistics import ExpressionStatistics
from faceposer.model.face_model import FaceModel, build_face_model, gram_of_shapes
from faceposer.model.subject import ARKIT_SHAPES
from faceposer.model.subject_file import load_subject
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import PoseProblem
from faceposer.training.capture import read_capture
from faceposer.training.expressions import Recipe, augment, clean, fit_statistics, learn_from_frames
from scripts.evaluation.judging import Method, Row, judge, judge_region
from scripts.evaluation.trials import FACE_REGIONS, make_trials, region_vertices, visible_anchors

TRAIN, TEST = "alex_rom_3.csv", "alex_rom_4.csv"
COUNTS = (1, 2, 4, 8, 16, 32)
REGION_COUNTS = (1, 4)
REGION_METHODS = ("mfa", "mfa-whole")
NOISE_PX = (0.0, 1.5)
SIZE = (800, 800)


def plain_statistics(examples: np.ndarray, recipe: Recipe) -> ExpressionStatistics:
    """Return statistics by maximum likelihood alone."""
    plain = replace(recipe, n_components=30, n_factors=10, fit_shrinkage=0.0, blend=0.0)
    return fit_statistics(examples, ARKIT_SHAPES, plain, "")


def dimensions_of_energy(model: FaceModel, energy: float) -> int:
    """Return how many components have the share ``energy`` of the variance."""
    return int(np.searchsorted(np.cumsum(model.subspace.variances) / model.subspace.variances.sum(), energy)) + 1


def make_methods(subject_name: str, frames: np.ndarray, recipe: Recipe) -> tuple[dict[str, Method], FaceModel]:
    """Return all methods, trained on ``frames``, and the model of the one that ships."""
    subject = load_subject(subject_name)
    metric = gram_of_shapes(load_subject("man"))
    ours = build_face_model(subject, learn_from_frames(frames, ARKIT_SHAPES, recipe, metric=metric))
    examples = augment(frames, ARKIT_SHAPES, recipe)
    plain = build_face_model(subject, plain_statistics(examples, recipe))
    paper_statistics = plain_statistics(frames, recipe)
    wide = build_face_model(subject, paper_statistics, len(ARKIT_SHAPES), "plain")
    paper = build_face_model(subject, paper_statistics, dimensions_of_energy(wide, 0.99), "plain")
    gaussian = ours.mixture.as_gaussian()

    def solved(model: FaceModel, **options: object) -> Method:
        return lambda constraints: (model, solve(PoseProblem(model, constraints, **options)))  # type: ignore[arg-type]

    return {
        "mfa": solved(ours),
        "mfa-whole": solved(ours, prior="whole"),
        "mfa-plain": solved(plain, mixture=plain.mixture),
        "ppca": solved(ours, mixture=gaussian),
        "pca": solved(paper, prior_weight=0.0),
        "mfa-paper": solved(paper, mixture=paper.mixture),
    }, ours


def regional_rows(
    methods: dict[str, Method], model: FaceModel, frames: np.ndarray, camera: Camera, poses: int, seed: int
) -> list[Row]:
    """Return the rows of the trials whose points lie in one region."""
    vertices = region_vertices(model.subject)
    # Brows are small: every vertex of them is a candidate, elsewhere every third.
    rows = []
    for i, region in enumerate(FACE_REGIONS):
        inside = set(vertices[region].tolist())
        anchors = visible_anchors(model, camera, 1 if region == "brows" else 3, inside)
        for noise_px in NOISE_PX:
            for count in REGION_COUNTS:
                enough = len(anchors) // 4
                trials = make_trials(model, frames, camera, anchors, count, noise_px, poses, [seed, count, i], enough)
                rows += [
                    judge_region(name, methods[name], trials, vertices, region, count, noise_px)
                    for name in REGION_METHODS
                ]
    return rows


def print_table(rows: list[Row], key: str, noise_px: float) -> None:
    """Print one value of all methods by the number of points."""
    for method in dict.fromkeys(str(row["method"]) for row in rows):
        values = [row[key] for row in rows if row["method"] == method and row["noise_px"] == noise_px]
        print(f"  {method:11}" + "".join(f"{value:9.3f}" for value in values))


def print_regions(rows: list[Row]) -> None:
    """Print what happens where all points lie in one region."""
    print("Points in one region: 3D error of the face, of the region, of the others (neutral = 1);")
    print("share of poses in which the others end worse than neutral; how far they move, and should, mm")
    for row in sorted(rows, key=lambda row: (row["region"], row["count"], row["noise_px"])):  # type: ignore[arg-type]
        print(
            f"  {row['region']:8}{row['count']:3} points, {row['noise_px']} px  {row['method']:10}"
            f"{row['error_3d_relative']:7.3f}{row['own_relative']:7.3f}{row['elsewhere_relative']:7.3f}"
            f"{row['elsewhere_worse']:7.2f}{row['moved_mm']:7.2f} of {row['truth_moved_mm']:.2f}"
        )
    for method in REGION_METHODS:
        of = [row for row in rows if row["method"] == method]
        keys = ("error_3d_relative", "own_relative", "elsewhere_relative", "elsewhere_worse", "moved_mm")
        means = [np.mean([float(row[key]) for row in of]) for key in keys]  # type: ignore[arg-type]
        print(f"  mean of all           {method:10}" + "".join(f"{value:7.3f}" for value in means))


def main() -> None:
    """Train, test and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="write the rows to this file")
    parser.add_argument("--subject", default="man", help="face to pose (default: man)")
    parser.add_argument("--poses", type=int, default=200, help="test frames per count (default: 200)")
    parser.add_argument(
        "--examples", type=int, default=Recipe().n_examples, help="to learn from (default: %(default)s)"
    )
    parser.add_argument("--seed", type=int, default=0, help="of frames, points and noise (default: 0)")
    options = parser.parse_args()
    folder = os.environ.get("FACEPOSER_CAPTURES")
    if not folder:
        sys.exit("Set FACEPOSER_CAPTURES to the folder with the capture files.")

    recipe = replace(Recipe(), n_examples=options.examples)
    train, test = (clean(read_capture(Path(folder) / take), recipe) for take in (TRAIN, TEST))
    began = time.perf_counter()
    methods, ours = make_methods(options.subject, train, recipe)
    print(f"trained on {len(train)} frames in {time.perf_counter() - began:.0f} s, {ours.n_coefficients} coefficients")
    vertices = ours.subject.vertices
    camera = OrbitView.preset(vertices.min(axis=0), vertices.max(axis=0)).camera(SIZE)

    anchors = visible_anchors(ours, camera)
    rows: list[Row] = []
    for noise_px in NOISE_PX:
        for count in COUNTS:
            trials = make_trials(ours, test, camera, anchors, count, noise_px, options.poses, [options.seed, count])
            rows += [judge(name, method, trials, count, noise_px) for name, method in methods.items()]
    print("points     " + "".join(f"{count:9}" for count in COUNTS))
    for noise_px in NOISE_PX:
        for key, title in (
            ("error_3d_relative", "3D error, neutral face = 1"),
            ("worse_than_neutral", "share of poses worse than the neutral face"),
            ("error_2d_px", "2D error, px"),
            ("ms", "median ms"),
        ):
            print(f"{title}; targets off by {noise_px} px")
            print_table(rows, key, noise_px)
    in_regions = regional_rows(methods, ours, test, camera, options.poses, options.seed)
    print_regions(in_regions)

    print("What the subspace cannot make of each shape at full strength, the worst ten:")
    unreached = sorted(ours.unreached().items(), key=lambda item: -item[1])
    for name, share in unreached[:10]:
        print(f"  {name:22}{100 * share:6.1f} %")
    if options.json:
        data = {
            "subject": options.subject,
            "train": TRAIN,
            "test": TEST,
            "rows": rows,
            "regions": in_regions,
            "unreached": dict(unreached),
        }
        options.json.write_text(json.dumps(data, indent=1) + "\n")


if __name__ == "__main__":
    main()
