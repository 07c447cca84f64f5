"""A cluster learns what one machine learns, and says in a sentence what is wrong with it."""

import builtins
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh_sequence import open_sequence
from faceposer.geometry.obj_io import write_obj
from faceposer.progress import CancelledError, Progress
from faceposer.training import cluster as cluster_module
from faceposer.training import frames as frames_module
from faceposer.training.cluster import cluster_frames, cluster_map
from faceposer.training.examples import ExampleOptions, character_from_examples
from faceposer.training.frames import spool_frames
from faceposer.training.streaming_pca import Region, regional_pca, scores_of
from tests.training.example_meshes import moving, reader_of, sequence_of, shaken, surface

distributed = pytest.importorskip("distributed", reason="the extra 'cluster' is not installed")
# What Dask warns of is not ours to mend.
pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """Two workers in threads of this process, spoken to as if they were elsewhere."""
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, protocol="tcp://", dashboard_address=None, silence_logs=50
    ) as cluster:
        yield cluster.scheduler_address


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frames_module, "_CHUNK_BYTES", 12 * 256 * 4)
    monkeypatch.setattr(cluster_module, "_PATIENCE_S", 2)


def double(chunk: np.ndarray, factor: float) -> np.ndarray:
    return factor * chunk


def test_same_components_and_scores_as_on_one_machine(tmp_path: Path, address: str) -> None:
    mesh = surface()
    reader = reader_of(sequence_of(shaken(moving(mesh, 90)), mesh, tmp_path / "a.npz"))
    n = len(mesh.vertices)
    mask = np.clip(np.linspace(1.5, -0.5, n), 0.0, 1.0).astype(np.float32)
    regions = [Region(np.arange(n), part, np.ones(n, dtype=np.float32)) for part in (mask, 1.0 - mask)]
    sample = reader.read(0, 3)
    with spool_frames(reader, Progress()) as store:
        expected = regional_pca(store, regions, sample, 4)
        expected_scores = scores_of(store, regions, expected)
    with cluster_frames(reader, address, Progress()) as store:
        assert (store.n_frames, store.n_vertices) == (90, n)
        found = regional_pca(store, regions, sample, 4)
        scores = scores_of(store, regions, found)
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one.energies, other.energies, rtol=1e-5)
        np.testing.assert_allclose(np.abs(np.sum(one.directions * other.directions, axis=1)), 1.0, atol=1e-5)
    np.testing.assert_allclose(np.abs(scores), np.abs(expected_scores), atol=1e-3)


def test_same_character_as_on_one_machine(tmp_path: Path, address: str) -> None:
    mesh = surface()
    path = tmp_path / "a.npz"
    np.savez(path, vertices=shaken(moving(mesh, 40)), faces=mesh.polygons)
    options = ExampleOptions("a", "A", segments="whole", n_dimensions=4, n_components=1, n_factors=2)
    alone = character_from_examples(path, options)
    together = character_from_examples(path, replace(options, scheduler=address))
    np.testing.assert_allclose(np.abs(together.shapes), np.abs(alone.shapes), atol=1e-4)
    assert together.summary is not None
    assert alone.summary is not None
    assert together.summary["kept_energy"] == pytest.approx(alone.summary["kept_energy"], abs=1e-4)


def test_results_come_in_order_and_the_workers_are_freed(
    tmp_path: Path, address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh = surface()
    monkeypatch.chdir(tmp_path)
    reader = reader_of(sequence_of(moving(mesh, 21), mesh, Path("a.npz")))
    with cluster_frames(reader, address, Progress()) as store:
        np.testing.assert_allclose(np.concatenate(list(store.run(double, 2.0))), 2.0 * reader.read(0, 21))
    with distributed.Client(address, set_as_default=False) as client:
        assert not client.who_has()


def test_stop_is_heard(tmp_path: Path, address: str) -> None:
    mesh = surface()
    reader = reader_of(sequence_of(moving(mesh, 9), mesh, tmp_path / "a.npz"))
    stages: list[str] = []
    progress = Progress(lambda stage, share: stages.append(stage), lambda: "Principal components" in stages)
    with pytest.raises(CancelledError), cluster_frames(reader, address, progress) as store:
        list(store.run(double, 1.0))


def test_file_that_a_worker_cannot_see_is_named(tmp_path: Path, address: str) -> None:
    mesh = surface()
    for i, frame in enumerate(moving(mesh, 6)):
        write_obj(tmp_path / f"{i}.obj", frame, mesh.polygons)
    reader = reader_of(open_sequence(tmp_path))
    (tmp_path / "4.obj").unlink()
    with (
        pytest.raises(FacePoserError, match=r"'.*4\.obj' cannot be read on the Dask worker tcp://.*same path"),
        cluster_frames(reader, address, Progress()),
    ):
        pass


def test_broken_frame_on_a_worker_has_its_own_sentence(tmp_path: Path, address: str) -> None:
    mesh = surface()
    frames = moving(mesh, 6)
    reader = reader_of(sequence_of(frames, mesh, tmp_path / "a.npz"))
    frames[5, 7, 1] = np.nan
    sequence_of(frames, mesh, tmp_path / "a.npz")
    with pytest.raises(FacePoserError, match=r"rame 6 of .*not finite"), cluster_frames(reader, address, Progress()):
        pass


def fail(chunk: np.ndarray) -> None:
    raise ArithmeticError("no luck")


def test_failure_on_a_worker_is_reported(tmp_path: Path, address: str) -> None:
    mesh = surface()
    reader = reader_of(sequence_of(moving(mesh, 6), mesh, tmp_path / "a.npz"))
    with (
        pytest.raises(FacePoserError, match=r"failed \(ArithmeticError: no luck\)"),
        cluster_frames(reader, address, Progress()) as store,
    ):
        list(store.run(fail))


@pytest.mark.parametrize("wrong", ["tcp://127.0.0.1:9", "nowhere", "smoke://a:1"])
def test_wrong_address(tmp_path: Path, wrong: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "_PATIENCE_S", 0.3)
    mesh = surface()
    reader = reader_of(sequence_of(moving(mesh, 6), mesh, tmp_path / "a.npz"))
    with pytest.raises(FacePoserError, match="No Dask scheduler answers at"), cluster_frames(reader, wrong, Progress()):
        pass


@pytest.mark.parametrize(
    "wrong", ["nowhere", "tcp://a:1x", "tcp://a:99999", "tcp://:8786", "smoke://a:1", "", "inproc://a"]
)
def test_no_client_is_made_for_what_is_no_address(wrong: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def connect(*_: object, **__: object) -> None:
        raise AssertionError("a client that is never connected blocks when it is removed")

    monkeypatch.setattr("distributed.Client", connect)
    with pytest.raises(FacePoserError, match="No Dask scheduler answers at"), cluster_map(wrong, Progress()):
        pass


def test_cluster_without_workers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "_PATIENCE_S", 0.5)
    mesh = surface()
    reader = reader_of(sequence_of(moving(mesh, 6), mesh, tmp_path / "a.npz"))
    with (
        distributed.LocalCluster(
            n_workers=0, processes=False, protocol="tcp://", dashboard_address=None, silence_logs=50
        ) as empty,
        pytest.raises(FacePoserError, match="has no workers; start some with: dask worker tcp://"),
        cluster_frames(reader, empty.scheduler_address, Progress()),
    ):
        pass


def test_missing_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = surface()
    reader = reader_of(sequence_of(moving(mesh, 6), mesh, tmp_path / "a.npz"))
    real = builtins.__import__

    def without(name: str, *arguments: Any, **keywords: Any) -> Any:
        if name == "distributed":
            raise ImportError(name)
        return real(name, *arguments, **keywords)

    monkeypatch.setattr(builtins, "__import__", without)
    with (
        pytest.raises(FacePoserError, match=r"pip install 'faceposer\[cluster\]'"),
        cluster_frames(reader, "tcp://127.0.0.1:9", Progress()),
    ):
        pass


def squared(value: int) -> int:
    if value < 0:
        raise FacePoserError(f"{value} is negative.")
    return value * value


def test_functions_are_mapped_in_order_and_their_errors_are_raised(address: str) -> None:
    with cluster_map(address, Progress()) as mapped:
        assert list(mapped(squared, [3, 1, 2])) == [9, 1, 4]
        with pytest.raises(FacePoserError, match="-1 is negative"):
            list(mapped(squared, [2, -1]))
