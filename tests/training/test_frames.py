"""Frames come back in order and without head motion, whatever keeps them, and nothing is left behind."""

import tempfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh_sequence import open_sequence
from faceposer.progress import CancelledError, Progress
from faceposer.training import frames as frames_module
from faceposer.training.frames import Frames, chunk_ranges, sample_of, spool_frames, steady_vertices, sum_of
from tests.training.example_meshes import moving, reader_of, sequence_of, shaken, surface


@pytest.fixture
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frames_module, "_CHUNK_BYTES", 12 * 256 * 5)


def first_of(chunk: Frames, plus: float) -> float:
    return float(chunk[0, 0, 0]) + plus


def count_and_sum(chunk: Frames) -> list[np.ndarray]:
    return [np.asarray(len(chunk)), chunk.sum(axis=0)]


def test_chunks_cover_all_frames_once() -> None:
    for count in (1, 5, 6, 1000):
        chunks = chunk_ranges(count, 60_000)
        assert [i for first, stop in chunks for i in range(first, stop)] == list(range(count))
    assert len(chunk_ranges(10, 100)) == 1


def test_head_motion_is_taken_out(tmp_path: Path) -> None:
    mesh = surface()
    still = moving(mesh, 40)
    reader = reader_of(sequence_of(shaken(still), mesh, tmp_path / "a.npz"))
    assert len(reader.steady) == round(0.3 * len(mesh.vertices))
    # Turned by up to half a radian, and what is left of it is a thousandth of how far the patches move.
    spread = np.abs(still - mesh.vertices).max()
    assert np.abs(reader.read(0, 40) - (still - mesh.vertices)).max() < 2e-2 * spread


def test_sample_is_spread_evenly_and_small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = surface()
    frames = moving(mesh, 50) + 1000.0
    sequence = sequence_of(frames, mesh, tmp_path / "a.npz")
    numbers, sample = sample_of(sequence, Progress(), 11)
    assert numbers == np.linspace(0, 49, 11).round().astype(int).tolist()
    expected = frames[numbers] - frames[numbers].mean(axis=1, keepdims=True)
    np.testing.assert_allclose(sample, expected, atol=2e-4)
    monkeypatch.setattr(frames_module, "_SAMPLE_BYTES", 3 * 12 * len(mesh.vertices))
    assert len(sample_of(sequence, Progress())[0]) == 3


def test_points_on_a_line_cannot_be_aligned() -> None:
    line = np.zeros((9, 3))
    line[:, 0] = np.arange(9)
    with pytest.raises(ValueError, match="not on a line"):
        steady_vertices(line[None].astype(np.float32), line)


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.parametrize("compressed", [False, True])
def test_spool_gives_all_frames_in_order(tmp_path: Path, compressed: bool) -> None:
    mesh = surface()
    frames = moving(mesh, 23)
    path = tmp_path / "a.npz"
    (np.savez_compressed if compressed else np.savez)(path, vertices=frames, faces=mesh.polygons)
    sequence = open_sequence(path)
    assert sequence.compressed == compressed
    reader = reader_of(sequence)
    expected = reader.read(0, 23)
    with spool_frames(reader, Progress()) as store:
        assert (store.n_frames, store.n_vertices) == (23, 256)
        np.testing.assert_array_equal(store.read(3, 17), expected[3:17])
        firsts = list(store.run(first_of, 1.0))
        np.testing.assert_allclose(firsts, expected[::5, 0, 0] + 1.0)
        count, total = store.total(count_and_sum)
        assert count == 23
        np.testing.assert_allclose(total, expected.sum(axis=0), atol=1e-4)


def test_processes_give_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = surface()
    reader = reader_of(sequence_of(shaken(moving(mesh, 30)), mesh, tmp_path / "a.npz"))
    monkeypatch.setattr(frames_module, "_WORTH_PROCESSES", 0)
    monkeypatch.setattr(frames_module.os, "cpu_count", lambda: 2)
    with spool_frames(reader, Progress()) as store:
        np.testing.assert_array_equal(store.read(0, 30), reader.read(0, 30))


def test_nothing_is_left_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))
    mesh = surface()
    reader = reader_of(sequence_of(moving(mesh, 4), mesh, tmp_path / "a.npz"))
    with spool_frames(reader, Progress()):
        assert list(scratch.iterdir())
    assert not list(scratch.iterdir())

    def stop(stage: str, share: float) -> None:
        raise CancelledError

    with pytest.raises(CancelledError), spool_frames(reader, Progress(stop)):
        pass
    assert not list(scratch.iterdir())


def test_frame_that_cannot_be_aligned_is_named(tmp_path: Path) -> None:
    mesh = surface()
    frames = moving(mesh, 4)
    frames[2] = 1.0
    reader = reader_of(sequence_of(moving(mesh, 4), mesh, tmp_path / "sound.npz"))
    broken = type(reader)(sequence_of(frames, mesh, tmp_path / "a.npz"), reader.steady)
    with pytest.raises(FacePoserError, match=r"frame 3 of '.*a\.npz' cannot be aligned"):
        broken.read(0, 4)


def test_full_disk_has_a_remedy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = surface()
    reader = reader_of(sequence_of(moving(mesh, 4), mesh, tmp_path / "a.npz"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "not there"))
    with pytest.raises(FacePoserError, match="TMPDIR"), spool_frames(reader, Progress()):
        pass


def test_disk_without_room_is_noticed_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = surface()
    reader = reader_of(sequence_of(moving(mesh, 4), mesh, tmp_path / "a.npz"))
    monkeypatch.setattr(frames_module.shutil, "disk_usage", lambda _: SimpleNamespace(free=12 * 4 * 256 - 1))
    with (
        pytest.raises(FacePoserError, match=r"No space left on device.*make 0\.0 GB free"),
        spool_frames(reader, Progress()),
    ):
        pass


def test_sums_leave_what_they_add_as_it_is() -> None:
    parts = [[np.ones(3, dtype=np.float32), np.asarray(2.0)], [np.full(3, 5.0), np.asarray(1.0)]]
    total = sum_of(iter(parts))
    np.testing.assert_array_equal(total[0], [6.0, 6.0, 6.0])
    assert total[1] == 3.0
    np.testing.assert_array_equal(parts[0][0], [1.0, 1.0, 1.0])
