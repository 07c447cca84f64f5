"""``faceposer identity learn``: learns a model of heads from unregistered scans."""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from faceposer.cli.arguments import output_path, whole_between
from faceposer.cli.identity.heads import ROOM
from faceposer.errors import FacePoserError, counted
from faceposer.files import paths
from faceposer.files.atomic import check_output, check_space
from faceposer.progress import Progress

NAME = "learn"

_MOST_ROUNDS, _MOST_MODES, _MOST_WORKERS = 20, 1000, 64


def add_parser(subcommands: Any) -> None:
    """Add the parser of ``learn`` to ``subcommands``."""
    parser = subcommands.add_parser(
        NAME,
        help="learn a model of heads from scans",
        description="Learn a model of heads from unregistered scans of different people (docs/identity.md).",
    )
    parser.add_argument("folder", metavar="FOLDER", help="folder with a mesh of each person's head")
    parser.add_argument("-o", "--output", type=output_path, required=True, metavar="MODEL.npz", help="write the model")
    parser.add_argument(
        "--rounds", type=whole_between(1, _MOST_ROUNDS), default=2, help="rounds of learning (default: 2)"
    )
    parser.add_argument(
        "--modes", type=whole_between(1, _MOST_MODES), help="most modes (default: one less than the scans)"
    )
    parser.add_argument("--from-mean", action="store_true", help="begin with the mean head instead of the whole model")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--workers", type=whole_between(1, _MOST_WORKERS), default=1, help="processes (default: 1)")
    where.add_argument("--scheduler", metavar="ADDRESS", help="compute on the workers of a Dask cluster")


def run(options: argparse.Namespace) -> int:
    """Learn the model, write it and return the exit status."""
    check_output(options.output, ".npz")
    check_space(options.output, ROOM[".npz"])
    files = _scans_in(options.folder)
    from faceposer.cli.progress_line import ProgressLine
    from faceposer.identity.model_file import load_identity_model, save_identity_model
    from faceposer.identity.scans.learning import FEWEST, learn_model, marked_file

    if len(files) < FEWEST:
        found = counted(len(files), "mesh", "meshes")
        raise FacePoserError(f"The folder '{options.folder}' has {found}; a model needs at least {FEWEST} scans.")
    line = ProgressLine(log=True)
    try:
        with _mapper(options, line.progress) as mapper:
            scans = []
            for scan in mapper(marked_file, files):
                scans.append(scan)
                line.progress.at("Finding the faces", len(scans) / len(files))
            learned = learn_model(
                scans,
                load_identity_model(),
                options.rounds,
                options.modes,
                options.from_mean,
                mapper,
                line.progress,
            )
    finally:
        line.clear()
    save_identity_model(options.output, learned.model)
    print(f"{learned.model.n_coefficients} modes of {len(scans)} scans")
    print(f"{options.output} written")
    return 0


def _scans_in(folder: str) -> list[str]:
    from faceposer.geometry.mesh_io import MESH_SUFFIXES

    place = paths.expand_user(folder)
    if not paths.is_dir(place):
        raise FacePoserError(f"'{folder}' is not a folder; give the folder of the scans.")
    # Clusters need paths that do not depend on the working folder.
    found = (path.resolve() for path in Path(place).iterdir() if path.suffix.lower() in MESH_SUFFIXES)
    return sorted(str(path) for path in found if paths.is_file(path))


@contextmanager
def _mapper(options: argparse.Namespace, progress: Progress) -> Iterator[Callable[..., Any]]:
    """Yield a function like `map`: in this process, in several, or on a cluster."""
    if options.scheduler is not None:
        from faceposer.training.cluster import cluster_map

        with cluster_map(options.scheduler, progress) as mapped:
            yield mapped
    elif options.workers > 1:
        from concurrent.futures import ProcessPoolExecutor
        from multiprocessing import get_context

        with ProcessPoolExecutor(options.workers, get_context("spawn")) as pool:
            yield pool.map
    else:
        yield map
