#!/usr/bin/env python3
"""Measure characters of random heads of the morphable model: blinks, penetrations, and time.

    python scripts/study_heads.py --json F             # 100 heads, 10 minutes of one core
    python scripts/study_heads.py --heads 5 --draws 10

For each head: the widest gap between closed lids as seen from the eye's centre; the depths of docs/contact.md after the
contact step, and the height of the mouth's lining above the skin of the chin, in the poses of the library at 100 and
150 % and in samples of the prior at 1.5 times its spread; and seconds for the character, its face model, its contact
step, and the poses. F is written after each head; the next run with the same seed and number of draws measures only the
heads that it lacks.
"""

import argparse
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from scipy import ndimage

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.files.atomic import atomic_file
from faceposer.identity.anatomy.eyeballs import ball_of
from faceposer.identity.character import character_of
from faceposer.identity.head import HeadMaker
from faceposer.identity.model_file import load_identity_model
from faceposer.model.character import Character
from faceposer.model.contact.measure import KINDS, penetration_mm
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.poses import applying
from faceposer.poses.library import starter_poses

Array = NDArray[np.float64]

#: What is measured: penetrations, and the height of the mouth's lining above the skin.
MEASURED = (*KINDS, "lining_skin")
STRENGTHS, SPREAD, ALLOWED_MM = (1.0, 1.5), 1.5, 0.1
#: Size of a cell of directions, in radians, and distance from the eye's centre of skin that can cover it, in radii.
_CELL, _NEAR = np.deg2rad(0.1), 2.2


def blink_gap_mm(character: Character, side: str, strength: float = 1.0) -> float:
    """Return the height of the widest gap between the lids of ``side`` ("Left" or "Right") in a blink.

    The skin is projected on directions from the eye's centre; the gap is the longest vertical run of directions of the
    open eye's opening that closed lids leave free, at the distance of the eyeball's surface.
    """
    part = character.part(f"eye_{side.lower()}")
    centre, radius = ball_of(character.vertices[slice(*part.vertices)].astype(np.float64))
    n = character.part("skin").vertices[1]
    triangles = character.triangles[(character.triangles < n).all(axis=1)]
    skin = character.vertices[:n] - centre
    blink = strength * character.shapes[character.shape_names.index(f"eyeBlink{side}"), :n]
    free, left = (~_covered(vertices, triangles, radius) for vertices in (skin, skin + blink))
    labels, _ = ndimage.label(free)
    middle = slice(len(free) // 2 - 60, len(free) // 2 + 60)
    inside = labels[middle, middle]
    opening = labels == np.bincount(inside[inside > 0]).argmax()
    run = np.zeros(len(free), dtype=int)
    longest = 0
    for row in left & ndimage.binary_dilation(opening, iterations=2):
        run = np.where(row, run + 1, 0)
        longest = max(longest, int(run.max()))
    return 10.0 * longest * _CELL * radius


def _covered(skin: Array, triangles: NDArray[np.int32], radius: float) -> NDArray[np.bool_]:
    """Return the mask of directions from the origin, by elevation and azimuth, that ``skin`` (N, 3) covers in front."""
    x, y, z = skin.T
    places = (np.stack([np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))], axis=1) + 0.5 * np.pi) / _CELL
    near = (np.linalg.norm(skin, axis=1) < _NEAR * radius) & (z > 0.0)
    size = int(np.pi / _CELL)
    image = Image.new("1", (size, size))
    draw = ImageDraw.Draw(image)
    for corners in places[triangles[near[triangles].all(axis=1)]].reshape(-1, 6).tolist():
        draw.polygon(corners, fill=1)
    return np.asarray(image)


def poses(model: FaceModel, draws: int, seed: int) -> tuple[list[str], Array]:
    """Return names of the poses to measure, and their coefficients, shape (n, r)."""
    library = [
        (f"{entry.title} {strength:.0%}", applying.applied(model, model.neutral(), entry.pose, strength))
        for entry in starter_poses()
        if entry.pose is not None and applying.weights_on(entry.pose, model.character) is not None
        for strength in STRENGTHS
    ]
    mean, _ = model.mixture.moments()
    sampled = mean + SPREAD * (model.mixture.draws(draws, np.random.default_rng(seed)) - mean)
    names = [name for name, _ in library] + [f"draw {i}" for i in range(draws)]
    return names, np.concatenate([np.array([pose for _, pose in library]), sampled])


def depths_mm(model: FaceModel, vertices: NDArray[np.float32]) -> dict[str, float]:
    """Return the greatest depth of each of `MEASURED` in a pose, in millimetres."""
    lips = HeadMaker.shipped().lips
    outside = -lips.lining.depth(vertices[: HeadMaker.shipped().n_skin].astype(np.float64)).min()
    return {**penetration_mm(model, vertices), "lining_skin": 10.0 * max(float(outside), 0.0)}


def study(skin: Array, draws: int, seed: int) -> dict[str, Any]:
    """Return the measurements of the head with ``skin``, shape (N, 3)."""
    times = [time.perf_counter()]
    character = character_of(skin, name="head", title="Head")
    times.append(time.perf_counter())
    model = build_face_model(character)
    times.append(time.perf_counter())
    contact = model.contact
    times.append(time.perf_counter())
    names, measured = poses(model, draws, seed)
    depths = [depths_mm(model, contact.apply(model.instance(pose))) for pose in measured]
    times.append(time.perf_counter())
    found = {kind: np.array([depth[kind] for depth in depths]) for kind in MEASURED}
    return {
        "blink_gap_mm": float(max(blink_gap_mm(character, side) for side in ("Left", "Right"))),
        "poses": len(depths),
        "deepest_mm": {kind: float(depth.max()) for kind, depth in found.items()},
        "deepest_pose": {kind: names[int(depth.argmax())] for kind, depth in found.items() if depth.max() > 0.0},
        "over": {kind: int((depth > ALLOWED_MM).sum()) for kind, depth in found.items()},
        "seconds": dict(zip(("character", "model", "contact", "poses"), np.diff(times).tolist(), strict=True)),
    }


def earlier_rows(path: Path | None, seed: int, draws: int) -> dict[int, dict[str, Any]]:
    """Return the rows by head in the file ``path`` of an earlier run with the same ``seed`` and ``draws``."""
    if path is None or not path.is_file():
        return {}
    rows = json.loads(path.read_text(encoding="utf-8"))
    return {row["head"]: row for row in rows if (row["seed"], row["draws"]) == (seed, draws)}


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--heads", type=int, default=100, help="number of heads (default: 100)")
    parser.add_argument("--draws", type=int, default=100, help="samples of the prior for each (default: 100)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path, metavar="F", help="file to write all measurements to")
    options = parser.parse_args()
    heads = load_identity_model()
    found = earlier_rows(options.json, options.seed, options.draws)
    for i, shape in enumerate(heads.sample(options.seed, options.heads)):
        if i not in found:
            row = study(heads.instance(shape), options.draws, i)
            found[i] = {"head": i, "seed": options.seed, "draws": options.draws, **row}
            if options.json is not None:
                with atomic_file(options.json, "measurements") as path:
                    path.write_text(json.dumps([found[k] for k in sorted(found)], indent=1) + "\n", encoding="utf-8")
        row = found[i]
        depths = ", ".join(f"{kind} {depth:.3f}" for kind, depth in row["deepest_mm"].items())
        print(
            f"head {i}: gap {row['blink_gap_mm']:.3f} mm, {depths} mm, {row['seconds']['character']:.2f} s", flush=True
        )
    rows = [found[i] for i in range(options.heads)]
    n_poses = sum(row["poses"] for row in rows)
    print(
        f"{len(rows)} heads: widest gap {max(row['blink_gap_mm'] for row in rows):.3f} mm; of {n_poses} poses, over "
        f"{ALLOWED_MM} mm:"
    )
    for kind in MEASURED:
        over = sum(row["over"][kind] for row in rows)
        print(f"  {kind}: {over} (deepest {max(row['deepest_mm'][kind] for row in rows):.3f} mm)")


if __name__ == "__main__":
    main()
