#!/usr/bin/env python3
"""Measure learning from as many meshes as in the paper: time, memory, and accuracy of the components.

    FACEPOSER_CAPTURES=FOLDER python scripts/study_training.py --json training.json
    FACEPOSER_CAPTURES=FOLDER python scripts/study_training.py --obj --folder FOLDER_WITH_25_GB

The built-in man, posed by two real takes, with noise on each vertex and random rigid motions of the head, gives 7,842
frames of 19,187 vertices. `train/...` is the whole command `faceposer train --examples`, from one file of arrays and,
with --obj, from a folder of OBJ files. The other rows learn only the leading components, of the whole face in the
program's metric, from aligned frames: `exact` decomposes all inner products of the frames, with all of them in memory;
`streaming` is the method of the program, `incremental` scikit-learn's IncrementalPCA with batches of 200, `rig` the
exact method in the rig's weights. `degrees_K` is the largest angle between the first K directions and the exact ones of
the same frames, including noise; `rig_degrees_K` is the angle to those of the rig's weights, without noise.
IncrementalPCA is centred at the mean, the program at the neutral face; each is compared with the exact components of
its kind. Memory is the resident memory of the process and its descendants. Rows run one after another in separate
processes.
"""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    # The program uses its own threads.
    os.environ.setdefault(variable, "1")

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import subspace_angles
from scipy.sparse.linalg import eigsh

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.geometry.mesh_sequence import frames_of
from faceposer.geometry.obj_io import read_obj
from faceposer.progress import Progress
from faceposer.training.frames import AlignedReader, SpooledFrames, sample_of, spool_frames, steady_vertices
from faceposer.training.modes import local_metric
from faceposer.training.streaming_pca import Region, regional_pca
from scripts.studying.example_data import ExampleData, example_data, write_examples
from scripts.studying.memory import PeakMemory

Array = NDArray[np.float64]
Row = dict[str, Any]

METHODS = ("exact", "streaming", "incremental", "rig")
BATCH = 200


def main() -> None:
    """Generate the data, run every row in a separate process and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=7842)
    parser.add_argument("--vertices", type=int, default=19187)
    parser.add_argument("--components", type=int, default=20)
    parser.add_argument("--obj", action="store_true", help="also train from a folder of OBJ files")
    parser.add_argument("--only", nargs="+", metavar="ROW", help="rows to measure, such as train/npz streaming")
    parser.add_argument("--folder", type=Path, help="folder in which the data is kept (default: a temporary folder)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="file to write the rows to")
    parser.add_argument("--method", choices=METHODS, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.folder is None:
        with tempfile.TemporaryDirectory(prefix="faceposer-study-") as folder:
            options.folder = Path(folder)
            study(options)
        return
    options.folder.mkdir(parents=True, exist_ok=True)
    if options.method:
        print(json.dumps(components(options)))
    else:
        study(options)


def study(options: argparse.Namespace) -> None:
    """Print the table, row by row."""
    began = time.perf_counter()
    paths = write_examples(example_data(options.frames, options.vertices), options.folder, options.obj)
    print(f"{options.frames} frames of {options.vertices} vertices, generated in {time.perf_counter() - began:.0f} s")
    names = [f"train/{kind}" for kind in ("npz", "obj") if kind in paths] + list(METHODS)
    rows: list[Row] = []
    for name in names:
        if options.only and name not in options.only:
            continue
        load = os.getloadavg()[0]
        row = trained(name, paths, options) if name.startswith("train/") else in_process(name, options)
        rows.append({"name": name, **row, "load_before": round(load, 1)})
        print("  ".join(f"{key} {value}" for key, value in rows[-1].items()), flush=True)
    if options.json:
        settings = {"frames": options.frames, "vertices": options.vertices, "components": options.components}
        options.json.write_text(json.dumps({**settings, "cores": os.cpu_count(), "rows": rows}, indent=1) + "\n")


def trained(name: str, paths: dict[str, Path], options: argparse.Namespace) -> Row:
    """Return time and memory of the whole command, and its summary."""
    output = options.folder / "trained.npz"
    source = paths[name.removeprefix("train/")]
    command = [sys.executable, "-m", "faceposer", "train", "--examples", str(source), "-o", str(output)]
    command += ["--neutral", str(paths["neutral"])] if source.is_file() else []
    began, used = time.perf_counter(), cpu_seconds()
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with (
        subprocess.Popen(command, stdout=subprocess.DEVNULL, env=environment) as process,
        PeakMemory(process.pid) as memory,
    ):
        status = process.wait()
    if status:
        sys.exit(f"{' '.join(command)} ended with {status}")
    from faceposer.model.character_file import load_character

    summary = load_character(str(output)).summary or {}
    return {
        "seconds": round(time.perf_counter() - began, 1),
        "cpu_seconds": round(cpu_seconds() - used, 1),
        "peak_gb": round(memory.bytes / 1e9, 2),
        "largest_process_gb": round(memory.largest / 1e9, 2),
        "dimensions": summary.get("dimensions"),
        "kept_energy": summary.get("kept_energy"),
        "worst": summary.get("worst"),
    }


def cpu_seconds() -> float:
    """Return the CPU time of all child processes that have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def in_process(name: str, options: argparse.Namespace) -> Row:
    """Return the row of ``components``, run in a separate process."""
    command = [sys.executable, __file__, "--method", name, "--folder", str(options.folder)]
    for key in ("frames", "vertices", "components"):
        command += [f"--{key}", str(getattr(options, key))]
    result = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    return dict(json.loads(result.stdout))


def components(options: argparse.Namespace) -> Row:
    """Return time, memory and accuracy of the components found by one method."""
    data = example_data(options.frames, options.vertices)
    neutral = read_obj(options.folder / "neutral.obj")
    sequence = frames_of(options.folder / "frames.npz", neutral, "the neutral")
    numbers, raw = sample_of(sequence, Progress())
    steady = steady_vertices(raw, neutral.vertices)
    sample = np.stack([*AlignedReader(sequence, steady).each(numbers)])
    del raw
    metric = local_metric(neutral.vertices, neutral.triangles(), (sample**2).sum(axis=2).mean(axis=0))
    scale = np.sqrt(metric.astype(np.float64))
    count = options.components
    if options.method == "rig":
        with PeakMemory() as memory:
            began = time.perf_counter()
            data.exact_basis(scale, count, centred=False)
            seconds = time.perf_counter() - began
        return {"seconds": round(seconds, 2), "peak_gb": round(memory.bytes / 1e9, 2)}
    n = len(neutral.vertices)
    everything = Region(np.arange(n), np.ones(n, dtype=np.float32), metric)
    with spool_frames(AlignedReader(sequence, steady), Progress()) as store, PeakMemory() as memory:
        began, used = time.perf_counter(), time.process_time()
        if options.method == "exact":
            basis, settled = decomposed(store, everything, count, options.folder / "exact.npz"), True
        elif options.method == "streaming":
            found = regional_pca(store, [everything], sample, count)[0]
            basis, settled = found.directions.T.astype(np.float64), found.converged
        else:
            basis, settled = incremental(store, everything, count), True
        seconds, used = time.perf_counter() - began, time.process_time() - used
    return {
        "seconds": round(seconds, 1),
        "cpu_seconds": round(used, 1),
        "peak_gb": round(memory.bytes / 1e9, 2),
        **accuracy(data, scale, basis, options.folder / "exact.npz", centred=options.method == "incremental"),
        "settled": settled,
    }


def decomposed(store: SpooledFrames, region: Region, count: int, path: Path) -> Array:
    """Return the components, (3 N, k), of all frames about the neutral face, and write those about the mean as well."""
    everything = np.concatenate([region.weigh(store.read(i, i + 1)) for i in range(store.n_frames)])
    inner = (everything @ everything.T).astype(np.float64)
    start = np.random.default_rng(0).standard_normal(len(inner))
    bases = {}
    for name in ("neutral", "mean"):
        if name == "mean":
            inner -= inner.mean(axis=0)
            inner -= inner.mean(axis=1)[:, None]
            everything -= everything.mean(axis=0, dtype=np.float64).astype(np.float32)
        axes = eigsh(inner, count, v0=start)[1][:, ::-1]
        bases[name] = np.linalg.qr(everything.T @ axes.astype(np.float32))[0]
    np.savez(path, **bases)
    return bases["neutral"].astype(np.float64)


def incremental(store: SpooledFrames, region: Region, count: int) -> Array:
    """Return the components, (3 N, k), of scikit-learn's IncrementalPCA."""
    from sklearn.decomposition import IncrementalPCA

    estimator = IncrementalPCA(count)
    for first in range(0, store.n_frames - count, BATCH):
        last = store.n_frames if store.n_frames - first - BATCH < count else first + BATCH
        estimator.partial_fit(region.weigh(store.read(first, last)))
    return estimator.components_.T.astype(np.float64)


def accuracy(data: ExampleData, scale: Array, basis: Array, path: Path, centred: bool) -> Row:
    """Return the difference of ``basis``, (3 N, k), from the exact components, as angles in degrees and energy."""
    k = basis.shape[1]
    exact, energies, total = data.exact_basis(scale, k, centred)
    references = {"rig_degrees": exact}
    if path.exists():
        with np.load(path, allow_pickle=False) as file:
            references["degrees"] = file["mean" if centred else "neutral"].astype(np.float64)
    row: Row = {}
    for name, reference in references.items():
        for count in sorted({max(1, k // 2), k}):
            angle = subspace_angles(basis[:, :count], reference[:, :count])[0]
            row[f"{name}_{count}"] = round(float(np.rad2deg(angle)), 3)
    basis = np.linalg.qr(basis)[0]
    weights = data.weights - data.weights.mean(axis=0) if centred else data.weights
    projected = weights @ ((data.shapes * scale[:, None]).reshape(len(data.shapes), -1) @ basis)
    row["kept"] = round(float((projected**2).sum() / len(weights) / total), 7)
    row["kept_exact"] = round(float(energies.sum() / total), 7)
    return row


if __name__ == "__main__":
    main()
