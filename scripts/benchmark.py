#!/usr/bin/env python3
"""Measure the response times of the program and of other techniques in one run.

    python scripts/benchmark.py --json benchmark.json

Rows are medians and 99th percentiles in milliseconds. `drag/N` is the time from a mouse move, with one of N points
being dragged, to new vertices and normals; `solve/points-4/...` is a warm solve alone. The other rows `solve/...` and
`scaling/...` are live drags, including the set-up of the problem: four distances, one of them set with a slider; a
stroke of a number of pixels, with its target being dragged; a curve with five control points, one of them being
dragged; five points being dragged with a number of fixed vertices (the paper's figure 14); a point being dragged beside
eight sketches. `pick/...` is from the pixels of a stroke to points of the face; `start` is from the command to the
first frame. `landmarks/...` are detection of a face, the points of one, a photo, and the mesh of the character.

With FACEPOSER_CAPTURES set, `scaling/examples-...` compares priors learned from different numbers of frames, which
takes minutes. `rivals/...` are then solves from the neutral face, including the set-up of the problem, of ours (`mfa`),
of the same objective with numerical gradients and of the other techniques of the evaluation, on the same unseen trials,
with 3D errors relative to the neutral face; `arap-factorised` excludes the factorisation for a new set of handles.

The last table compares ratios of these times with their targets.
"""

import os

THREADS = 1
for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    # Set before NumPy is imported: threads slow down operations on small matrices.
    os.environ[variable] = str(THREADS)

import argparse
import json
import platform
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.geometry.camera import Camera, OrbitView
from faceposer.geometry.mesh import VertexNormals
from faceposer.geometry.picking import SurfacePoint, surface_positions
from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import PoseProblem
from scripts.benchmarking.constraint_rows import circle, constraint_rows, example_rows, pick_rows, scaling_rows
from scripts.benchmarking.landmark_rows import landmark_rows
from scripts.benchmarking.rivals import FiniteDifferences, mesh_rows, print_ratios, ratio_rows, rival_rows
from scripts.benchmarking.timing import Row, row

SIZE = (1280, 800)
# Mouth corners, chin, brows, cheeks, upper lip, left lower lid.
FEATURES = ("8.3", "8.4", "2.1", "4.1", "4.2", "5.3", "8.1", "3.3")


def pins(model: FaceModel, camera: Camera, count: int) -> list[PointConstraint]:
    """Return ``count`` point constraints at their positions on the neutral face."""
    features = model.character.feature_points
    anchors = [SurfacePoint.at_vertex(model.triangles, features[name]) for name in FEATURES[:count]]
    pixels = camera.project(surface_positions(model.character.vertices, model.triangles, anchors))
    return [PointConstraint(a, (float(u), float(v)), camera) for a, (u, v) in zip(anchors, pixels, strict=True)]


def mouse_path(constraints: list[PointConstraint], moves: int) -> Iterator[list[PointConstraint]]:
    """Yield the constraints at each move of a drag that circles out and back, the first point under the pointer."""
    u, v = constraints[0].target
    for du, dv in circle(moves):
        yield [replace(constraints[0], target=(u + du, v + dv)), *constraints[1:]]


def drag_rows(model: FaceModel, camera: Camera, moves: int) -> list[Row]:
    """Measure a live drag from the mouse move to vertices and normals."""
    normals_of = VertexNormals(model.triangles, len(model.character.vertices))
    rows = []
    for count in (1, 8):
        p, times = model.neutral(), []
        for constraints in mouse_path(pins(model, camera, count), moves):
            began = time.perf_counter()
            p = solve(PoseProblem(model, constraints), p).coefficients
            normals_of(model.instance(p))
            times.append((time.perf_counter() - began) * 1e3)
        rows.append(row(f"drag/{count}", times[1:]))
    return rows


def solve_rows(model: FaceModel, camera: Camera, moves: int) -> list[Row]:
    """Measure the same warm solves with the prior, without it, and with finite differences."""
    times: dict[str, list[float]] = {"mfa": [], "pca": [], "finite-difference": []}
    poses = {name: model.neutral() for name in times}
    for constraints in mouse_path(pins(model, camera, 4), moves):
        problems = {
            "mfa": PoseProblem(model, constraints),
            "pca": PoseProblem(model, constraints, bare=True),
            "finite-difference": FiniteDifferences(model, constraints),
        }
        # Interleaved at every move, so that other load affects all three equally.
        for name, problem in problems.items():
            began = time.perf_counter()
            poses[name] = solve(problem, poses[name]).coefficients
            times[name].append((time.perf_counter() - began) * 1e3)
    return [row(f"solve/points-4/{name}", values[1:]) for name, values in times.items()]


def start_row(repeats: int) -> Row:
    """Measure the time from the command to the window's first frame, in new processes."""
    command = [sys.executable, "-m", "faceposer", "--exit-after-first-frame"]
    times = []
    for attempt in range(repeats + 1):
        began = time.perf_counter()
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise SystemExit(f"'{' '.join(command[1:])}' failed: {done.stderr.strip()}")
        reported = re.search(r"first frame after ([\d.]+) s", done.stdout + done.stderr)
        seconds = float(reported.group(1)) if reported else time.perf_counter() - began
        if attempt > 0:
            times.append(seconds * 1e3)
    return row("start", times)


def machine() -> Row:
    """Return the properties of the machine that affect the results."""
    model = ""
    info = Path("/proc/cpuinfo")
    if info.exists():
        found = re.search(r"model name\s*:\s*(.+)", info.read_text())
        model = found.group(1) if found else ""
    return {
        "processor": model or platform.processor(),
        "cores": os.cpu_count(),
        "threads": THREADS,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "system": platform.system(),
    }


def main() -> None:
    """Run all measurements and print them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="file to write the rows to")
    parser.add_argument("--character", default="man", help="character to measure on (default: man)")
    parser.add_argument("--moves", type=int, default=400, help="mouse moves per drag (default: 400)")
    parser.add_argument("--no-examples", action="store_true", help="skip 'scaling/examples-...', which learns priors")
    parser.add_argument("--trials", type=int, default=60, help="trials of each row of rivals (default: 60; 0 for none)")
    parser.add_argument("--no-start", action="store_true", help="skip the row 'start', which opens windows")
    options = parser.parse_args()

    # First, so that a missing display is detected before the other measurements.
    start = [] if options.no_start else [start_row(5)]
    model = build_face_model(load_character(options.character))
    vertices = model.character.vertices
    camera = OrbitView.preset(vertices.min(axis=0), vertices.max(axis=0)).camera(SIZE)
    rows = drag_rows(model, camera, options.moves)
    rows += solve_rows(model, camera, options.moves)
    rows += constraint_rows(model, camera, options.moves)
    rows += scaling_rows(model, camera, options.moves)
    if not options.no_examples:
        rows += example_rows(model, camera, options.moves)
    rows += pick_rows(model, camera, max(options.moves // 8, 1))
    rows += landmark_rows(model.character, max(options.moves // 8, 1))
    normals_of = VertexNormals(model.triangles, len(vertices))
    rows += mesh_rows(model, options.moves, [("normals", lambda: normals_of(vertices))])
    if options.trials > 0:
        rows += rival_rows(options.character, options.trials)
    rows += start

    print(f"{len(vertices)} vertices, {model.n_coefficients} coefficients, {THREADS} thread")
    print(f"{'':34}{'count':>6}{'median ms':>12}{'99 % ms':>12}{'evaluations':>13}{'3D error':>10}")
    for entry in rows:
        times = f"{entry['median_ms']:12.3f}{entry['p99_ms']:12.3f}"
        more = f"{entry.get('evaluations', ''):>13}{entry.get('error_3d_relative', ''):>10}"
        print(f"{entry['name']:34}{entry['count']:6}{times}{more}")
    ratios = ratio_rows(rows)
    print_ratios(ratios)
    if options.json:
        options.json.write_text(json.dumps({"machine": machine(), "rows": rows, "ratios": ratios}, indent=2) + "\n")


if __name__ == "__main__":
    main()
