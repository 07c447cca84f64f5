#!/usr/bin/env python3
"""Compare methods of transferring expressions from the man to other characters (see docs/transfer.md).

    python -m scripts.build_assets --examples goblin
    python scripts/study_transfer.py --capture alex_rom_4.csv --examples goblin --json transfer.json

Errors are mean vertex distances of the skin from the truth, relative to those of the neutral face. For characters with
ARKit's shapes, the truth is the same weights on their own rig, which transfer by weights gives by construction. For the
creature, which has none of them, it is the example sculpted for the same expression, without the ears, which have no
counterpart on the man.

  three        heights of mouth and eyes, minimum to minimum and maximum to maximum: the paper
  three, bent  the same, neutral to neutral
  all, straight  all pairs, minimum to minimum and maximum to maximum
  all          all pairs, neutral to neutral: the default
  all, front   the same, with distances in a front view
  weights      weights of ARKit's shapes by name
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
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.errors import FacePoserError
from faceposer.evaluation.takes import steady
from faceposer.geometry.mesh_io import read_mesh
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.performance import Performance
from faceposer.model.shape_names import weight_map
from faceposer.training.expressions import Recipe, clean
from faceposer.transfer.distances import DistanceTransfer
from faceposer.transfer.pairs import DEFAULT_PAIRS, PAPER_PAIRS
from faceposer.transfer.transfer import Transfer, make_transfer, transfer_performance
from scripts.asset_building.creature_expressions import EXPRESSIONS

Array = NDArray[np.float64]

WAYS = {
    "three": ("distances", PAPER_PAIRS, "paper"),
    "three, bent": ("distances", PAPER_PAIRS, "neutral"),
    "all, straight": ("distances", DEFAULT_PAIRS, "paper"),
    "all": ("distances", DEFAULT_PAIRS, "neutral"),
    "weights": ("weights", DEFAULT_PAIRS, "neutral"),
}
SIDES = ("Left", "Right")


def ways(source: FaceModel, target: FaceModel) -> dict[str, Transfer]:
    """Return the methods that apply from ``source`` to ``target``."""
    found: dict[str, Transfer] = {}
    for name, (method, pairs, scaling) in WAYS.items():
        try:
            found[name] = make_transfer(source, target, method, pairs, scaling)  # type: ignore[arg-type]
        except FacePoserError:
            continue
    found["all, front"] = DistanceTransfer(flat(source), flat(target))
    return {name: found[name] for name in (*list(WAYS)[:-1], "all, front", "weights") if name in found}


def flat(model: FaceModel) -> FaceModel:
    """Return ``model`` without depth: distances are those in a front view, coefficients are unchanged."""
    vertices, basis = model.character.vertices.copy(), model.basis.copy()
    vertices[:, 2] = 0.0
    basis[:, 2::3] = 0.0
    return replace(model, basis=basis, character=replace(model.character, vertices=vertices))


def judged(model: FaceModel) -> NDArray[np.intp]:
    """Return the vertices to evaluate: the skin without parts that only the creature has."""
    part = next(part for part in model.character.parts if part.material == "skin")
    skin = np.arange(*part.vertices)
    if model.character.shape_names[0] in ARKIT_SHAPES:
        return skin
    ears = [ids for name, ids in model.character.regions.items() if name.startswith("ear")]
    return np.setdiff1d(skin, np.concatenate(ears)) if ears else skin


def weights_on(model: FaceModel, frame: Array) -> Array:
    """Return ``frame``, weights of ``ARKIT_SHAPES``, in the order of the model's shapes."""
    weights: Array = weight_map(model.character.shape_names, ARKIT_SHAPES) @ frame
    return weights


def relative(model: FaceModel, poses: list[Array], truths: list[Array]) -> float:
    """Return the error of ``poses`` against vertices ``truths``, relative to the neutral face."""
    ids = judged(model)
    rest = model.character.vertices[ids]
    off = sum(
        float(np.linalg.norm(model.instance(p)[ids] - t[ids], axis=1).mean())
        for p, t in zip(poses, truths, strict=True)
    )
    return off / sum(float(np.linalg.norm(rest - t[ids], axis=1).mean()) for t in truths)


def rig_vertices(model: FaceModel, weights: Array) -> Array:
    """Return the vertices of the rig with ``weights``, without the model's subspace."""
    return model.character.vertices + np.tensordot(weights, model.character.shapes.astype(np.float64), 1)


def known_rigs(man: FaceModel, targets: dict[str, FaceModel], frames: Array) -> dict[str, dict[str, float]]:
    """Return the error of each method by target, for frames with the same weights as truth."""
    table = {}
    for name, target in targets.items():
        truths = [rig_vertices(target, weights_on(target, frame)) for frame in frames]
        sources = [man.coefficients_of(weights_on(man, frame)) for frame in frames]
        table[name] = {
            way: relative(target, [transfer.pose(p) for p in sources], truths)
            for way, transfer in ways(man, target).items()
        }
    return table


def examples(man: FaceModel, creature: FaceModel, folder: Path) -> dict[str, dict[str, float]]:
    """Return the error of each method on the creature's example expressions, in groups and overall."""
    expressions: dict[str, tuple[Array, Array]] = {}
    for name, strengths in EXPRESSIONS.items():
        values = {
            one: min(strength, 1.0)
            for shape, strength in strengths.items()
            if not shape.startswith("ear")
            for one in ([shape] if shape in ARKIT_SHAPES else [shape + side for side in SIDES])
        }
        expressions[name] = (man.coefficients_of(values), read_mesh(folder / f"{name}.obj").vertices)
    groups = {
        "feelings": ("smile", "grin", "laugh", "frown", "sorrow", "anger", "snarl", "disgust", "fear", "surprise"),
        "one side": (
            "smirk_left",
            "smirk_right",
            "brow_left",
            "brow_right",
            "wink_left",
            "wink_right",
            "doubt_left",
            "doubt_right",
        ),
        "speech": tuple(name for name in expressions if name.startswith("viseme")),
        "all": tuple(expressions),
    }
    table: dict[str, dict[str, float]] = {group: {} for group in groups}
    for way, transfer in ways(man, creature).items():
        poses = {name: transfer.pose(source) for name, (source, _) in expressions.items()}
        for group, names in groups.items():
            truths = [expressions[name][1] for name in names]
            table[group][way] = relative(creature, [poses[name] for name in names], truths)
    return table


def free_poses(man: FaceModel, targets: dict[str, FaceModel], count: int) -> dict[str, dict[str, float]]:
    """Return the error of the target's distances, relative to their ranges, for free poses.

    Free poses are samples of the principal components with weights beyond the rig's limits, as a pose dragged without
    a prior may have.
    """
    rng = np.random.default_rng(1)
    poses = 0.5 * rng.standard_normal((count, man.n_coefficients)) * np.sqrt(man.subspace.variances)
    table = {}
    for name, target in targets.items():
        measure = DistanceTransfer(man, target)
        wanted = measure.distances(poses)
        table[name] = {
            way: float((np.abs(measure.reached(np.array([t.pose(p) for p in poses])) - wanted) / measure.widths).mean())
            for way, t in ways(man, target).items()
        }
    return table


def round_trips(man: FaceModel, targets: dict[str, FaceModel], frames: Array) -> dict[str, dict[str, float]]:
    """Return the error of the man's frames after a transfer to each target and back."""
    sources = [man.coefficients_of(weights_on(man, frame)) for frame in frames]
    truths = [man.instance(p).astype(np.float64) for p in sources]
    table: dict[str, dict[str, float]] = {}
    for name, target in targets.items():
        back = ways(target, man)
        table[name] = {
            way: relative(man, [back[way].pose(there.pose(p)) for p in sources], truths)
            for way, there in ways(man, target).items()
        }
    return table


def motion(man: FaceModel, targets: dict[str, FaceModel], frames: Array) -> dict[str, dict[str, float]]:
    """Return processor milliseconds per frame, and the roughness of the target relative to the source.

    Roughness is the mean change of velocity between frames, relative to the mean velocity.
    """
    source = Performance.from_weights(man, np.array([weights_on(man, frame) for frame in frames]), 60.0)
    table = {}
    for name, target in targets.items():
        transfer = DistanceTransfer(man, target)
        transfer.pose(man.neutral())
        began = time.process_time()
        result = transfer_performance(transfer, source)
        table[name] = {
            "ms a frame": 1e3 * (time.process_time() - began) / len(result),
            "roughness": roughness(target, result) / roughness(man, source),
        }
    return table


def roughness(model: FaceModel, performance: Performance) -> float:
    """Return the mean change of velocity of the evaluated vertices, relative to their mean velocity."""
    ids = judged(model)[::7]
    paths = np.array([model.instance(p)[ids] for p in performance.coefficients], dtype=np.float64)
    steps = np.diff(paths, axis=0)
    return float(np.linalg.norm(np.diff(steps, axis=0), axis=2).mean() / np.linalg.norm(steps, axis=2).mean())


def show(title: str, table: dict[str, dict[str, float]]) -> None:
    """Print ``table`` as Markdown."""
    columns = list(dict.fromkeys(key for row in table.values() for key in row))
    print(f"\n{title}\n\n| | {' | '.join(columns)} |\n|---|{'---:|' * len(columns)}")
    for name, row in table.items():
        print(f"| {name} | {' | '.join(f'{row[key]:.3f}' if key in row else '' for key in columns)} |")


def main() -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--capture", type=Path, required=True, metavar="CSV", help="take that the prior was not learned from"
    )
    parser.add_argument("--examples", type=Path, metavar="DIR", help="folder of the creature's examples")
    parser.add_argument("--character", action="append", default=[], metavar="NPZ", help="additional target character")
    parser.add_argument("--frames", type=int, default=100, help="number of frames of the take (default: 100)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="file to write all numbers to")
    options = parser.parse_args()
    models = {n: build_face_model(load_character(n)) for n in ("man", "woman", "low", "creature", *options.character)}
    man, creature = models["man"], models["creature"]
    others = {Path(name).stem: model for name, model in models.items() if model is not man}
    rigs = {name: model for name, model in others.items() if model is not creature}
    take = clean(steady(options.capture, Recipe().jump), Recipe())
    frames = take[np.linspace(0, len(take) - 1, options.frames).round().astype(np.intp)]
    tables = {"Same weights on the target's own rig": known_rigs(man, rigs, frames)}
    if options.examples is not None:
        tables["The creature's own examples"] = examples(man, creature, options.examples)
    tables["Error of the distances for free poses, relative to their ranges"] = free_poses(man, others, options.frames)
    tables["There and back"] = round_trips(man, others, frames)
    tables["Animation"] = motion(man, others, take[:300])
    for title, table in tables.items():
        show(title, table)
    if options.json is not None:
        options.json.write_text(json.dumps(tables, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
