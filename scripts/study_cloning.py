#!/usr/bin/env python3
"""Measure cloning by examples as in tables 2 to 4 of Pyun et al. 2003 (see docs/cloning.md).

    python scripts/study_cloning.py --capture alex_rom_4.csv --choose-from alex_rom_3.csv --json cloning.json

Table 2 clones each face to itself, table 3 to another face and back; both compare with the original on the skin. Table
4 is the processor time of both, in every row: for the keys (preprocess) and for each frame.

Keys: 6 emotional keys; 19 with the thirteen visemes; 84 with their compositions; "84 chosen" from the frames of another
take. All have the neutral face among them, and the targets are the characters' own poses, or proposals.

Rivals: Noh and Neumann's expression cloning, Sumner and Popović's deformation transfer, both with a correspondence from
all feature points; and transfer by distances and by weights.

Table "noise": the man's frames on the low head, against the same weights there, and on the creature, against the poses
by distances, with keys whose targets have errors, as those made by hand: each weight is multiplied by a random factor
of mean 1. Table "compose": time to compose 84 keys of 19 on both faces. "key_error_cm" is the largest distance of a
vertex of a clone from its key.
"""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.errors import FacePoserError
from faceposer.evaluation.cloning.correspondence import Skin
from faceposer.evaluation.cloning.deformation_transfer import DeformationTransfer
from faceposer.evaluation.cloning.expression_cloning import ExpressionCloning
from faceposer.evaluation.cloning.measures import clone_errors
from faceposer.evaluation.takes import steady
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.shape_names import weight_map
from faceposer.session.key_compositions import compose_keys
from faceposer.session.key_folder import EXPRESSION, KeyFolder
from faceposer.session.key_proposals import create_keys, make_proposer
from faceposer.session.keys import load_keys
from faceposer.training.expressions import Recipe, clean
from faceposer.transfer.distances import DistanceTransfer
from faceposer.transfer.examples import ExampleTransfer, KeyPair
from faceposer.transfer.key_coverage import chosen_frames
from faceposer.transfer.key_parameters import PAPER_POINTS, PAPER_THRESHOLD
from faceposer.transfer.transfer import Transfer, make_transfer

Array = NDArray[np.float64]
#: From a performance of the source, (F, N, 3) on its skin and (F, r), to one of the target, in the same two forms.
Way = Callable[["Play"], "Play"]
#: Rows of tables; None where a method does not apply.
Rows = list[dict[str, Any] | None]
# Standard deviation of the factors of the table "noise", number of draws, and thresholds to compare with damping.
NOISE, NOISE_SEEDS = 0.1, 5
THRESHOLDS = (1e-3, 1e-4, PAPER_THRESHOLD, 1e-6, 1e-8)
# Thresholds of tables 2 and 3.
FIXED: dict[str, dict[str, Any]] = {
    "examples, threshold": {"threshold": PAPER_THRESHOLD},
    "examples, fine": {"threshold": 1e-8},
}


@dataclass(frozen=True, eq=False)
class Play:
    """Frames of one face: vertices of its skin, (F, N, 3), and coefficients, (F, r), if it has any."""

    skin: Array
    poses: Array | None = None


@dataclass(eq=False)
class Face:
    """A face of the study, with its frames and the frames that keys may be chosen from, as coefficients."""

    name: str
    path: str
    model: FaceModel
    frames: Array
    candidates: Array

    def __post_init__(self) -> None:
        """Prepare its skin."""
        self.skin = Skin.of(self.model.character)
        part = next(part for part in self.model.character.parts if part.material == "skin")
        self.rows = slice(*part.vertices)
        self.still = np.abs(self.model.character.shapes[:, self.rows]).max(axis=(0, 2)) < 1e-6 * self.skin.height

    def play(self, poses: Array) -> Play:
        """Return the frames ``poses``, shape (F, r)."""
        return Play(np.array([self.model.instance(pose)[self.rows] for pose in poses], dtype=np.float64), poses)


def faces(names: list[str], captures: tuple[Path, Path], count: int) -> dict[str, Face]:
    """Return the faces by name, with ``count`` frames of the take; those without ARKit's shapes follow the man."""
    takes = [clean(steady(path, Recipe().jump), Recipe()) for path in captures]
    frames = takes[0][np.linspace(0, len(takes[0]) - 1, count).round().astype(np.intp)]
    candidates = takes[1][::5]
    found: dict[str, Face] = {}
    for path in names:
        model = build_face_model(load_character(path))
        shapes = weight_map(model.character.shape_names, ARKIT_SHAPES)
        if shapes.any():
            own = [(weights @ shapes.T) @ model.subspace.projection.T for weights in (frames, candidates)]
        else:
            man = found["man"]
            by_distances = DistanceTransfer(man.model, model)
            own = [np.array([by_distances.pose(pose) for pose in poses]) for poses in (man.frames, man.candidates[::2])]
        found[Path(path).stem] = Face(Path(path).stem, path, model, own[0], own[1])
    return found


def key_sets(source: Face, target: Face, folder: Path, rows: list[dict[str, Any]]) -> dict[str, list[KeyPair]]:
    """Return the sets of keys by name, and add the time of their composition to ``rows``."""
    keys = create_keys(folder / f"{source.name}-{target.name}", source.path, target.path)
    found = {"6": _of_folder(keys, EXPRESSION), "19": _of_folder(keys)}
    began = time.process_time()
    compose_keys(keys)
    seconds = round(time.process_time() - began, 3)
    rows.append({"table": "compose", "source": source.name, "target": target.name, "seconds": seconds})
    print(f"{source.name} {target.name}: keys composed in {seconds} s", flush=True)
    return found | {"84": _of_folder(keys), "84 chosen": chosen(source, target, 83)}


def _of_folder(keys: KeyFolder, kind: str | None = None) -> list[KeyPair]:
    kinds = keys.kinds()
    pairs = load_keys(keys).transfer.pairs
    return [pair for pair in pairs if kind is None or kinds.get(pair.name) == kind]


def chosen(source: Face, target: Face, count: int) -> list[KeyPair]:
    """Return keys chosen from the candidates of ``source``, with proposals for ``target``."""
    none = np.zeros((0, source.model.n_coefficients))
    ids = [helpful.frame for helpful in chosen_frames(source.model, none, source.candidates, count)]
    if source is target:
        return [KeyPair(str(i), source.candidates[i], source.candidates[i]) for i in ids]
    proposer = make_proposer(source.model, target.model)
    return [KeyPair(str(i), source.candidates[i], proposer.pose(source.candidates[i])) for i in ids]


def by_poses(source: Face, target: Face, transfer: Transfer) -> Way:
    """Return the way by a ``transfer`` of poses."""

    def way(play: Play) -> Play:
        assert play.poses is not None
        return target.play(np.array([transfer.pose(pose) for pose in play.poses]))

    return way


def by_vertices(rival: ExpressionCloning | DeformationTransfer) -> Way:
    """Return the way of a rival that knows vertices only."""
    return lambda play: Play(np.array([rival.clone(vertices) for vertices in play.skin]))


def ways(source: Face, target: Face) -> dict[str, Callable[[], Way]]:
    """Return what prepares each rival between two faces."""
    found: dict[str, Callable[[], Way]] = {
        "Noh and Neumann": lambda: by_vertices(ExpressionCloning(source.skin, target.skin)),
        "deformation transfer": lambda: by_vertices(DeformationTransfer(source.skin, target.skin, source.still)),
        "distances": lambda: by_poses(source, target, make_transfer(source.model, target.model, "distances")),
        "weights": lambda: by_poses(source, target, make_transfer(source.model, target.model, "weights")),
    }
    return found


def by_examples(source: Face, target: Face, keys: list[KeyPair], **options: Any) -> Callable[[], Way]:
    """Return what prepares cloning by ``keys``."""
    return lambda: by_poses(source, target, ExampleTransfer(source.model, target.model, keys, **options))


def key_error(source: Face, target: Face, keys: list[KeyPair]) -> float:
    """Return the largest distance of a vertex of the clone of a key from the key on the target."""
    transfer = ExampleTransfer(source.model, target.model, keys)
    gaps = [target.model.instance(transfer.pose(key.source)) - target.model.instance(key.target) for key in keys]
    return round(max(float(np.linalg.norm(gap, axis=1).max()) for gap in gaps), 8)


def noisy(keys: list[KeyPair], target: Face, noise: float, seed: int) -> list[KeyPair]:
    """Return the ``keys`` with each weight of their targets multiplied by a random factor of mean 1."""
    rng = np.random.default_rng(seed)
    still = target.model.neutral()
    found = []
    for key in keys:
        weights = target.model.weights_of(key.target)
        error = target.model.coefficients_of(noise * rng.normal(size=weights.shape) * weights) - still
        found.append(KeyPair(key.name, key.source, key.target + error))
    return found


def noise_rows(source: Face, target: Face, sets: dict[str, list[KeyPair]], count: int) -> list[dict[str, Any]]:
    """Return the errors with exact and with noisy keys, by damping and by thresholds, as means over the draws."""
    rows_in = slice(0, None, max(len(source.frames) // count, 1))
    poses, truth = source.frames[rows_in], target.play(target.frames[rows_in]).skin
    rows: list[dict[str, Any]] = []
    for label, keys in sets.items():
        for noise, threshold in product((0.0, NOISE), (None, *THRESHOLDS)):
            errors = []
            for seed in range(NOISE_SEEDS if noise else 1):
                given = noisy(keys, target, noise, seed)
                transfer = ExampleTransfer(source.model, target.model, given, threshold=threshold)
                errors.append(clone_errors(target.play(transfer.poses(poses)).skin, truth, target.skin.vertices))
            paper = float(np.mean([error.paper for error in errors]))
            row = {"table": "noise", "source": source.name, "target": target.name, "keys": label, "noise": noise}
            row |= {"threshold": threshold, "draws": len(errors), "error_paper_norm_percent": round(paper, 5)}
            moved = float(np.mean([error.displacement for error in errors]))
            rows.append(row | {"error_displacement_relative": round(moved, 6)})
            print(f"noise {label:10} {noise:.2f} {threshold or 'damped'!s:7} {paper:8.4f} %", flush=True)
    return rows


def swapped(keys: list[KeyPair]) -> list[KeyPair]:
    """Return the ``keys`` in the other direction."""
    return [KeyPair(key.name, key.target, key.source) for key in keys]


def measured(
    table: int, source: Face, via: Face | None, method: str, steps: list[Callable[[], Way]], count: int, **more: Any
) -> dict[str, Any] | None:
    """Return a row: the error after all ``steps``, over ``count`` frames; None where the method does not apply."""
    play = truth = source.play(source.frames[:: max(len(source.frames) // count, 1)][:count])
    preparing = running = 0.0
    for step in steps:
        began = time.process_time()
        try:
            way = step()
        except FacePoserError:
            return None
        preparing += time.process_time() - began
        began = time.process_time()
        play = way(play)
        running += time.process_time() - began
    errors = clone_errors(play.skin, truth.skin, source.skin.vertices)
    row = {
        "table": table,
        "source": source.name,
        "target": source.name if via is None else via.name,
        "via": None if via is None else via.name,
        "method": method,
        **more,
        "frames": len(truth.skin),
        "error_paper_percent": [round(value, 5) for value in errors.paper_axes],
        "error_paper_norm_percent": round(errors.paper, 5),
        "error_displacement_relative": round(errors.displacement, 6),
        "ms_per_frame": round(1e3 * running / len(truth.skin) / len(steps), 3),
        "preprocess_s": round(preparing / len(steps), 4),
    }
    print(
        f"{table} {row['source']:9} {row['via'] or '':9} {method:22} {more.get('keys', ''):10}"
        f" {errors.paper:8.4f} % {errors.displacement:8.4f} {row['ms_per_frame']:8.2f} ms {row['preprocess_s']:.3f} s",
        flush=True,
    )
    return row


def self_clones(face: Face, folder: Path, frames: int, few: int, extra: list[dict[str, Any]]) -> Rows:
    """Return the rows of table 2 of a face."""
    rows: Rows = []
    for label, keys in key_sets(face, face, folder, extra).items():
        variants: dict[str, dict[str, Any]] = {"examples": {}}
        if label == "84 chosen":
            variants |= FIXED
        elif label == "19":
            variants["examples, 20 points"] = {"points": PAPER_POINTS}
            variants |= {f"examples, {regions}": {"regions": regions} for regions in ("halves", "parts")}
        error = key_error(face, face, keys)
        for how, options in variants.items():
            more: dict[str, Any] = {"keys": label} | ({} if options else {"key_error_cm": error})
            rows.append(measured(2, face, None, how, [by_examples(face, face, keys, **options)], frames, **more))
    for method, way in ways(face, face).items():
        rows.append(measured(2, face, None, method, [way], few))
    return rows


def round_trips(man: Face, via: Face, folder: Path, frames: int, few: int, extra: list[dict[str, Any]]) -> Rows:
    """Return the rows of table 3 from the ``man`` to a face and back; those of the table "noise" go to ``extra``."""
    rows: Rows = []
    sets = key_sets(man, via, folder, extra)
    if via.name in ("low", "creature"):
        extra += noise_rows(man, via, {name: sets[name] for name in ("19", "84", "84 chosen")}, frames)
    for label, keys in sets.items():
        error = key_error(man, via, keys)
        variants: dict[str, dict[str, Any]] = {"examples": {}} | (FIXED if label == "84 chosen" else {})
        for how, options in variants.items():
            there = by_examples(man, via, keys, **options)
            back = by_examples(via, man, swapped(keys), **options)
            more: dict[str, Any] = {"keys": label} | ({} if options else {"key_error_cm": error})
            rows.append(measured(3, man, via, how, [there, back], frames, **more))
    for method, way in ways(man, via).items():
        rows.append(measured(3, man, via, method, [way, ways(via, man)[method]], few))
    return rows


def study(found: dict[str, Face], frames: int, few: int) -> list[dict[str, Any]]:
    """Return all rows."""
    extra: list[dict[str, Any]] = []
    rows: Rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for face in found.values():
            rows += self_clones(face, folder, frames, few, extra)
        man = found["man"]
        for via in (face for face in found.values() if face is not man):
            rows += round_trips(man, via, folder, frames, few, extra)
    return [row for row in rows if row is not None] + extra


def main() -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--capture", type=Path, required=True, metavar="CSV", help="take to clone")
    parser.add_argument("--choose-from", type=Path, required=True, metavar="CSV", help="take to choose keys from")
    parser.add_argument("--character", action="append", default=[], metavar="NPZ", help="additional character")
    parser.add_argument("--built-in", nargs="+", default=["man", "woman", "low", "creature"], help=argparse.SUPPRESS)
    parser.add_argument("--frames", type=int, default=200, help="number of frames (default: 200)")
    parser.add_argument("--rival-frames", type=int, default=25, help="number of frames of rivals (default: 25)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="file to write all rows to")
    options = parser.parse_args()
    names = [*options.built_in, *options.character]
    found = faces(names, (options.capture, options.choose_from), options.frames)
    rows = study(found, options.frames, options.rival_frames)
    if options.json is not None:
        options.json.write_text(json.dumps(rows, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
