#!/usr/bin/env python3
"""Evaluate characters learned from a few example meshes on held-out examples.

    python -m scripts.build_assets --examples goblin          # fifty examples of the program's own goblin
    python scripts/study_examples.py goblin --json examples.json

The examples are divided into folds. A character is learned from the neutral face and all folds but one; moving visible
points of each held-out example are constrained to their pixels, with a noise of 1.5 px, and the pose is compared with
the example. Errors are mean vertex distances of the skin, relative to those of the neutral face.

  face     the default: modes for brows, eyes, ears and the mouth with its cheeks, coupled as in the examples
  face-9   the same with nine modes in all
  whole    principal components of the whole face
  whole-5  five of them, as in the paper for its characters of thirty examples (section 9)
  free     the modes of `face` without any prior (its weight is 0)
"""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse
import json
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.geometry.camera import Camera, OrbitView
from faceposer.geometry.mesh import VertexNormals
from faceposer.geometry.mesh_sequence import MeshSequence, frames_of, open_sequence, write_frames
from faceposer.geometry.picking import SurfacePoint
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.progress import Progress
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import PoseProblem
from faceposer.training.examples import ExampleOptions, character_from_sequence

COUNTS = (1, 2, 4, 8, 16)
NOISE_PX, MOVES_PX = 1.5, 1.0
SIZE = (800, 800)
METHODS: dict[str, tuple[dict[str, object], float]] = {
    "face": ({}, 1.0),
    "face-9": ({"n_dimensions": 9}, 1.0),
    "whole": ({"segments": "whole"}, 1.0),
    "whole-5": ({"segments": "whole", "n_dimensions": 5}, 1.0),
    "free": ({}, 0.0),
}


def learned(frames: list[np.ndarray], sequence: MeshSequence, options: ExampleOptions) -> FaceModel:
    """Return the model learned from the neutral face and ``frames``."""
    mesh = sequence.neutral
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "frames.npz"
        write_frames(path, [mesh.vertices, *frames], len(frames) + 1, len(mesh.vertices))
        return build_face_model(character_from_sequence(frames_of(path, mesh, "neutral"), "", options, Progress()))


def constraints_of(
    model: FaceModel, truth: np.ndarray, camera: Camera, count: int, rng: np.random.Generator
) -> list[PointConstraint] | None:
    """Return ``count`` moving visible points of the example ``truth``, (N, 3), or None if there are fewer."""
    vertices, triangles = model.character.vertices, model.character.triangles
    normals = VertexNormals(triangles, len(vertices))(vertices)
    facing = np.einsum("nd,nd->n", normals, camera.center - vertices) > 0.2 * np.linalg.norm(camera.center)
    pixels = camera.project(truth)
    moving = np.hypot(*(pixels - camera.project(vertices)).T) > MOVES_PX
    skin = np.zeros(len(vertices), dtype=bool)
    skin[slice(*max(model.character.parts, key=lambda part: part.vertices[1] - part.vertices[0]).vertices)] = True
    candidates = np.flatnonzero(facing & moving & skin)
    if len(candidates) < count:
        return None
    chosen = rng.choice(candidates, count, replace=False)
    targets = pixels[chosen] + NOISE_PX * rng.standard_normal((count, 2))
    return [
        PointConstraint(SurfacePoint.at_vertex(triangles, int(vertex)), (float(u), float(v)), camera)
        for vertex, (u, v) in zip(chosen, targets, strict=True)
    ]


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder of example meshes, one of them neutral")
    parser.add_argument("--folds", type=int, default=6, help="number of folds (default: 6)")
    parser.add_argument("--repeats", type=int, default=3, help="random choices of points for each example (default: 3)")
    parser.add_argument("--json", type=Path, help="file to write the rows to")
    options = parser.parse_args()
    sequence = open_sequence(options.folder)
    frames = [frame for frame in sequence.read(0, len(sequence)) if np.abs(frame - sequence.neutral.vertices).max() > 0]
    order = np.random.default_rng(0).permutation(len(frames))
    errors: dict[tuple[str, int], list[tuple[float, float]]] = {}
    for fold in range(options.folds):
        left_out = order[fold :: options.folds]
        kept = [frames[i] for i in np.setdiff1d(order, left_out)]
        for name, (settings, weight) in METHODS.items():
            model = learned(kept, sequence, replace(ExampleOptions("a", "A"), **settings))  # type: ignore[arg-type]
            character = model.character
            assert character.origin is not None
            skin = slice(*max(character.parts, key=lambda part: part.vertices[1] - part.vertices[0]).vertices)
            camera = OrbitView.preset(character.vertices.min(axis=0), character.vertices.max(axis=0)).camera(SIZE)
            for i in left_out.tolist():
                truth = character.vertices + character.origin.character_vertices(frames[i], len(character.vertices))
                neutral_error = float(np.linalg.norm(truth - character.vertices, axis=1)[skin].mean())
                for count in COUNTS:
                    for repeat in range(options.repeats):
                        rng = np.random.default_rng([i, count, repeat])
                        constraints = constraints_of(model, truth, camera, count, rng)
                        if constraints is None:
                            continue
                        solution = solve(PoseProblem(model, constraints, prior_weight=weight))
                        pose = model.instance(solution.coefficients)
                        error = float(np.linalg.norm(pose - truth, axis=1)[skin].mean())
                        errors.setdefault((name, count), []).append((error, neutral_error))
    rows = []
    print(f"{len(frames)} examples, {options.folds} folds; 3D error (neutral = 1) and share worse than neutral")
    print("points   " + "".join(f"{count:14}" for count in COUNTS))
    for name in METHODS:
        line = f"{name:9}"
        for count in COUNTS:
            found = np.array(errors[name, count])
            relative, worse = found[:, 0].sum() / found[:, 1].sum(), float((found[:, 0] > found[:, 1]).mean())
            rows.append({"method": name, "count": count, "error_3d_relative": relative, "worse_than_neutral": worse})
            line += f"{relative:8.3f} {worse:5.2f}"
        print(line)
    if options.json:
        options.json.write_text(json.dumps({"examples": len(frames), "rows": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()
