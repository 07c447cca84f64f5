#!/usr/bin/env python3
"""Measure the accuracy and smoothness of a face that follows trajectories of a known performance.

    FACEPOSER_CAPTURES=FOLDER python scripts/study_animation.py --json animation.json
    FACEPOSER_CAPTURES=FOLDER python scripts/study_animation.py --pictures animation.jpg
    FACEPOSER_CAPTURES=FOLDER python scripts/study_animation.py --tune

Learned from take 3, tested on take 4 of the same performer: the 300 frames with the most motion and no tracking jump,
and all other such runs. Seven points (Lau et al. 2009, figure 8a: ends of the brows, lips, corners of the mouth, chin)
are taken from the true faces, in an image of 800 x 800 pixels or in space, exactly or with noise.

  error  mean distance to the true face in millimetres, over frames and the vertices of the face's regions
  jerk   root mean square of the third difference from frame to frame, mm, of the same vertices, and of the brows
  worst  largest step from one frame to the next, root mean square over these vertices, mm

With --tune, weights and variants are compared on both folds of take 3 instead.
"""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.animation import following
from faceposer.animation.following import solve_trajectories
from faceposer.animation.terms import CHANGE
from faceposer.animation.trajectories import Trajectories
from faceposer.evaluation.setting import StudyContext
from faceposer.evaluation.takes import FOLDS
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.solve.constraints.fixed import PX_PER_CM
from faceposer.solve.problem import PoseProblem
from faceposer.training.capture import read_capture

TRAIN, TEST = "alex_rom_3.csv", "alex_rom_4.csv"
RATE = 30.0
N_FRAMES, N_LONG = 300, 1_000
NOISE_PX = 1.5
SEVEN = ("4.1", "4.2", "8.1", "8.2", "8.3", "8.4", "2.10")
#: Smoothness without look-ahead: the weight with the least error on the folds, with noise.
CAUSAL = 0.1
STILL = ("ear_left", "ear_right", "eye_left", "eye_right", "neck", "scalp")
Array = np.ndarray
Change = Callable[[Trajectories], Trajectories]


class Study:
    """Character with its prior, and the measures on it."""

    def __init__(self, setting: StudyContext) -> None:
        """Use the character of ``setting``."""
        self.setting = setting
        self.model = setting.model

    @cached_property
    def _face(self) -> Array:
        regions = self.model.character.regions
        return np.unique(np.concatenate([regions[name] for name in regions if name not in STILL]))

    @cached_property
    def _brows(self) -> Array:
        regions = self.model.character.regions
        return np.isin(self._face, np.concatenate([regions["brow_left"], regions["brow_right"]]))

    @cached_property
    def _true_shapes(self) -> Array:
        shapes = self.model.character.shapes[:, self._face]
        return 10.0 * shapes.reshape(len(shapes), -1).astype(np.float32)

    @cached_property
    def _basis(self) -> Array:
        basis = self.model.basis.reshape(self.model.n_coefficients, -1, 3)[:, self._face]
        return 10.0 * basis.reshape(len(basis), -1)

    def tracked(self, weights: Array, noise_px: float, seed: int = 0, in_space: bool = False) -> Trajectories:
        """Return the trajectories of the seven points in the true frames with rig ``weights``, (F, S)."""
        ids = [self.model.character.feature_points[name] for name in SEVEN]
        at_rest = self.model.character.vertices[ids].astype(np.float64)
        places = at_rest + np.einsum("fs,snd->fnd", weights, self.model.character.shapes[:, ids].astype(np.float64))
        rng = np.random.default_rng(seed)
        points = SurfacePoints.at_vertices(ids)
        if in_space:
            noise = rng.normal(size=places.shape) * noise_px / PX_PER_CM
            return Trajectories(SEVEN, points, places + noise, RATE)
        camera = self.setting.camera
        pixels = np.array([camera.project(frame) for frame in places])
        return Trajectories(SEVEN, points, pixels + rng.normal(size=pixels.shape) * noise_px, RATE, camera)

    def face_places(self, poses: Array) -> Array:
        """Return the offsets of the face's vertices from the neutral face in ``poses``, (F, r), (F, n, 3), mm."""
        return (poses.astype(np.float32) @ self._basis).reshape(len(poses), -1, 3)

    def measures(self, performance: Performance, weights: Array) -> dict[str, float]:
        """Return the error of a performance for the true ``weights``, (F, S), and its smoothness, in millimetres."""
        true = (weights.astype(np.float32) @ self._true_shapes).reshape(len(weights), -1, 3)
        ours = self.face_places(performance.coefficients)
        return {
            "error": float(np.linalg.norm(ours - true, axis=2).mean()),
            "of neutral": float(np.linalg.norm(true, axis=2).mean()),
            **{f"jerk{of}": _rms(np.diff(x, 3, axis=0)) for of, x in (("", ours), (" of truth", true))},
            **{
                f"brow jerk{of}": _rms(np.diff(x[:, self._brows], 3, axis=0))
                for of, x in (("", ours), (" of truth", true))
            },
            **{f"worst{of}": _worst(x) for of, x in (("", ours), (" of truth", true))},
        }


def _rms(offsets: Array) -> float:
    return float(np.sqrt((offsets**2).sum(axis=-1).mean()))


def _worst(positions: Array) -> float:
    steps = np.diff(positions, axis=0)
    return float(np.sqrt((steps**2).sum(axis=2).mean(axis=1)).max())


@contextmanager
def changed(owner: Any, name: str, value: Any) -> Iterator[None]:
    """Replace the attribute ``name`` of ``owner`` within the block."""
    kept = getattr(owner, name)
    setattr(owner, name, value)
    try:
        yield
    finally:
        setattr(owner, name, kept)


_problem = following._FrameProblems.problem


def _seen_from_neutral(frames: following._FrameProblems, frame: int, _seen_from: Array) -> PoseProblem:
    return _problem(frames, frame, frames.start)


@dataclass(frozen=True)
class Case:
    """Kind of trajectories, and options of their solve."""

    name: str
    options: dict[str, Any]
    noise_px: float = NOISE_PX
    in_space: bool = False
    change: Change | None = None
    from_neutral: bool = False

    def run(self, study: Study, runs: list[Array]) -> dict[str, float]:
        """Return the measures over all ``runs`` of true weights."""
        rows = []
        for seed, weights in enumerate(runs):
            tracks = study.tracked(weights, self.noise_px, seed, self.in_space)
            if self.change is not None:
                tracks = self.change(tracks)
            problem = _seen_from_neutral if self.from_neutral else _problem
            with changed(following._FrameProblems, "problem", problem):
                rows.append(study.measures(solve_trajectories(study.model, tracks, **self.options), weights))
        totals = {key: np.array([row[key] for row in rows]) for key in rows[0]}
        return {
            key: float(
                values.max()
                if key.startswith("worst")
                else np.sqrt((values**2).mean())
                if "jerk" in key
                else values.mean()
            )
            for key, values in totals.items()
        }


def jump_free_runs(
    setting: StudyContext, path: Path, n_frames: int, part: tuple[float, float] = (0.0, 1.0)
) -> list[tuple[int, Array]]:
    """Return the runs of ``n_frames`` without tracking jumps in a part of a take: first frame and weights."""
    recipe = setting.recipe
    take = read_capture(path).with_shapes(ARKIT_SHAPES)
    rest = np.percentile(take.without_jumps(recipe.jump).weights, recipe.rest_percentile, axis=0)
    frames = setting.rig_weights(np.clip(take.weights - rest, 0.0, 1.0))
    watched = [not name.startswith("eyeBlink") for name in take.shape_names]
    jumps = np.flatnonzero(np.abs(np.diff(take.weights[:, watched], axis=0)).max(axis=1) > recipe.jump) + 1
    begin, end = (round(share * len(frames)) for share in part)
    runs = []
    while begin + n_frames <= end:
        inside = jumps[(jumps > begin) & (jumps < begin + n_frames)]
        if len(inside):
            begin = int(inside[-1])
            continue
        runs.append((begin, frames[begin : begin + n_frames]))
        begin += n_frames
    return runs


def liveliest(study: Study, path: Path) -> tuple[int, Array]:
    """Return the run of a take with the most motion of the vertices."""

    def speed(weights: Array) -> float:
        steps = np.diff(weights, axis=0)
        return float(np.einsum("fs,st,ft->", steps, study.model.gram, steps))

    return max(jump_free_runs(study.setting, path, N_FRAMES), key=lambda run: speed(run[1]))


def with_gaps(tracks: Trajectories) -> Trajectories:
    """Return the trajectories with a fifth of each point missing, ten frames at a time, and all for a second."""
    rng = np.random.default_rng(1)
    positions = tracks.positions.copy()
    for point in range(positions.shape[1]):
        for first in rng.integers(0, len(positions) - 10, len(positions) // 50):
            positions[first : first + 10, point] = np.nan
    middle = len(positions) // 2
    positions[middle : middle + 30] = np.nan
    return replace(tracks, positions=positions)


def with_jumps(tracks: Trajectories) -> Trajectories:
    """Return the trajectories with a deviation of 30 pixels in 2 % of the positions."""
    rng = np.random.default_rng(2)
    hit = rng.random(tracks.seen.shape) < 0.02
    positions = tracks.positions.copy()
    positions[hit] += rng.normal(size=(int(hit.sum()), positions.shape[2])) * 30.0
    return replace(tracks, positions=positions)


def cases() -> list[Case]:
    """Return the cases to compare."""
    rough, causal, smooth = {"smoothness": 0.0}, {"smoothness": CAUSAL, "look_ahead": False}, dict[str, Any]()
    found = []
    for where, in_space in (("2D", False), ("3D", True)):
        for noise in (NOISE_PX, 0.0):
            kind = f"{where}, {'noise' if noise else 'exact'}"
            found += [
                Case(f"{kind}: without smoothness", rough, noise, in_space),
                Case(f"{kind}: frame by frame, as in the paper", causal, noise, in_space),
                Case(f"{kind}: all frames together (default)", smooth, noise, in_space),
            ]
    return [
        *found,
        Case("2D, exact: all frames together, smoothness 0.1", {"smoothness": 0.1}, 0.0),
        Case("2D, noise: all frames together, prior whole", {"prior": "whole"}),
        Case("2D, noise: all frames together, prior about the neutral face", smooth, from_neutral=True),
        Case("2D, noise, gaps: without smoothness", rough, change=with_gaps),
        Case("2D, noise, gaps: all frames together", smooth, change=with_gaps),
        Case("2D, noise, jumps: kept", smooth, change=with_jumps),
        Case(
            "2D, noise, jumps: discarded (default)", smooth, change=lambda tracks: with_jumps(tracks).without_jumps()[0]
        ),
    ]


def _plain_metric(model: FaceModel, smoothness: float, rate: float) -> Array:
    plain = model.subspace.directions.T @ model.gram @ model.subspace.directions
    return smoothness * (rate / RATE) ** 3 / CHANGE**2 / float(np.diag(plain) @ model.subspace.variances) * plain


def shown(name: str, found: dict[str, float]) -> str:
    """Return a line of the table."""
    cells = [f"{found['error']:.2f}", f"{found['error'] / found['of neutral']:.2f}"]
    cells += [f"{found[key]:.2f}" for key in ("jerk", "brow jerk", "worst")]
    return f"| {name} | " + " | ".join(cells) + " |"


def study(folder: Path) -> dict[str, Any]:
    """Print the tables and return their values."""
    setting = StudyContext.of(load_character("man"), [read_capture(folder / TRAIN).with_shapes(ARKIT_SHAPES)])
    studied = Study(setting)
    first, lively = liveliest(studied, folder / TEST)
    runs = [weights for _, weights in jump_free_runs(setting, folder / TEST, N_FRAMES)]
    result: dict[str, Any] = {"first frame": first, "runs": len(runs)}
    for title, chosen in ((f"frames {first} to {first + N_FRAMES - 1}", [lively]), (f"all {len(runs)} runs", runs)):
        truth = cases()[0].run(studied, chosen)
        print(f"\nTake 4, {title}; error of the neutral face {truth['of neutral']:.2f} mm, the truth has")
        print(f"jerk {truth['jerk of truth']:.2f}, brow jerk {truth['brow jerk of truth']:.2f}", end=" ")
        print(f"and worst {truth['worst of truth']:.2f}\n")
        print("| | error | relative | jerk | brow jerk | worst |\n| --- | --- | --- | --- | --- | --- |")
        result[title] = {}
        for case in cases():
            if len(chosen) > 1 and (case.in_space or case.change is not None):
                continue
            result[title][case.name] = found = case.run(studied, chosen)
            print(shown(case.name, found), flush=True)
    take = jump_free_runs(replace(setting, recipe=replace(setting.recipe, jump=1e9)), folder / TEST, N_LONG)
    tracks = studied.tracked(take[0][1], NOISE_PX)
    wall, cpu = time.perf_counter(), time.process_time()
    solve_trajectories(studied.model, tracks)
    result["seconds"] = time.perf_counter() - wall
    print(f"\n{N_LONG} frames: {result['seconds']:.1f} s, {time.process_time() - cpu:.1f} s of one core")
    return result


def tune(folder: Path) -> dict[str, Any]:
    """Print the error of weights and variants on the folds of take 3, and return it."""
    take = read_capture(folder / TRAIN).with_shapes(ARKIT_SHAPES)
    folds = []
    for (begin, end), tested in FOLDS.values():
        part = slice(round(begin * len(take.weights)), round(end * len(take.weights)))
        setting = StudyContext.of(load_character("man"), [replace(take, weights=take.weights[part])])
        runs = [weights for _, weights in jump_free_runs(setting, folder / TRAIN, N_FRAMES, tested)]
        folds.append((Study(setting), runs))
    result: dict[str, Any] = {}

    def row(name: str, from_neutral: bool = False, **options: Any) -> None:
        case = Case(name, options, from_neutral=from_neutral)
        result[name] = found = [case.run(studied, runs) for studied, runs in folds]
        cells = [f"{fold['error']:.3f}" for fold in found]
        cells += [f"{np.sqrt(np.mean([fold[key] ** 2 for fold in found])):.2f}" for key in ("jerk", "brow jerk")]
        print(f"| {name} | " + " | ".join(cells) + " |", flush=True)

    print("| | error: fold 1 | fold 2 | jerk | brow jerk |\n| --- | --- | --- | --- | --- |")
    for smoothness in (0.0, 0.1, 0.3, 1.0, 3.0):
        row(f"smoothness {smoothness:g}", smoothness=smoothness)
    for smoothness in (0.03, 0.1, 0.3):
        row(f"frame by frame, smoothness {smoothness:g}", smoothness=smoothness, look_ahead=False)
    for weight in (0.3, 3.0):
        row(f"prior weight {weight:g}", prior_weight=weight)
    row("prior whole", prior="whole")
    row("prior plain", prior="plain")
    with changed(following, "_START_PRIOR", 0.0):
        row("prior about the previous frame alone")
    row("prior about the neutral face", from_neutral=True)
    with changed(following, "smoothness_metric", _plain_metric):
        row("smoothness of vertices alone")
    return result


def filmstrip(folder: Path, path: Path, n_pictures: int = 8) -> None:
    """Draw frames of the run with the most motion, truth above and ours below, with targets green, points blue."""
    from faceposer.geometry.camera import OrbitView
    from faceposer.render.offscreen import render_character

    setting = StudyContext.of(load_character("man"), [read_capture(folder / TRAIN).with_shapes(ARKIT_SHAPES)])
    studied = Study(setting)
    model = studied.model
    _, weights = liveliest(studied, folder / TEST)
    tracks = studied.tracked(weights, NOISE_PX)
    performance = solve_trajectories(model, tracks)
    view = OrbitView((0.0, -0.4, 8.0), 0.0, 0.0, 72.0)
    camera = view.camera((250, 310))
    columns = []
    for frame in np.linspace(0, N_FRAMES - 1, n_pictures + 2).round().astype(int)[1:-1]:
        pose = performance.coefficients[frame]
        true = Image.fromarray(render_character(model.character, setting.vertices_of(weights[frame]), camera))
        ours = Image.fromarray(render_character(model.character, model.instance(pose), camera))
        draw = ImageDraw.Draw(ours)
        # Pixels of the study's camera, at the depth of each point, projected into this view.
        own = model.positions_at(tracks.points, pose)
        depth = setting.camera.to_camera(own)[:, 2]
        for (u, v), z, point in zip(tracks.positions[frame], depth, own, strict=True):
            local = np.array([(u - 400.0) * z, (v - 400.0) * z, setting.camera.focal * z]) / setting.camera.focal
            target = setting.camera.rotation.T @ (local - setting.camera.translation)
            for place, colour, radius in ((target, (40, 200, 90), 4), (point, (40, 120, 255), 2)):
                x, y = camera.project(place[None])[0]
                draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=colour)
        column = Image.new("RGB", (camera.size[0], 2 * camera.size[1] + 6), "white")
        column.paste(true, (0, 0))
        column.paste(ours, (0, camera.size[1] + 6))
        columns.append(column)
    sheet = Image.new("RGB", (len(columns) * (camera.size[0] + 4) - 4, columns[0].height), "white")
    for i, column in enumerate(columns):
        sheet.paste(column, (i * (camera.size[0] + 4), 0))
    sheet.save(path, quality=90)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="file to write the numbers to")
    parser.add_argument("--tune", action="store_true", help="compare weights and variants on the folds of take 3")
    parser.add_argument("--pictures", type=Path, metavar="FILE", help="only draw eight frames, truth above, ours below")
    options = parser.parse_args()
    folder = os.environ.get("FACEPOSER_CAPTURES")
    if not folder or not (Path(folder) / TEST).is_file():
        sys.exit(f"Set FACEPOSER_CAPTURES to the folder with {TRAIN} and {TEST}.")
    if options.pictures is not None:
        filmstrip(Path(folder), options.pictures)
        return
    result = tune(Path(folder)) if options.tune else study(Path(folder))
    if options.json is not None:
        options.json.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
