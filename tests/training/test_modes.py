"""Modes of regions add up to the examples, and what does not move has none."""

from pathlib import Path

import numpy as np

from faceposer.progress import Progress
from faceposer.training.frames import spool_frames
from faceposer.training.modes import KEEP, learn_modes, local_metric
from faceposer.training.segments import Segments, whole_face
from tests.training.example_meshes import SIDE, moving, reader_of, sequence_of, surface


def halves(n: int) -> Segments:
    """Return what lies low and high, with a soft border, of a grid whose rows go up."""
    high = np.clip((np.arange(n) // SIDE - 6) / 4.0, 0.0, 1.0).astype(np.float32)
    return Segments(("lower", "upper"), np.stack([1.0 - high, high]))


def test_modes_and_weights_make_the_examples(tmp_path: Path) -> None:
    mesh = surface()
    frames = moving(mesh, 80)
    reader = reader_of(sequence_of(frames, mesh, tmp_path / "a.npz"))
    displacements = reader.read(0, 80)
    metric = local_metric(mesh.vertices, mesh.triangles(), (displacements**2).sum(axis=2).mean(axis=0))
    ids = np.arange(len(mesh.vertices))
    for segments in (whole_face(len(ids)), halves(len(ids))):
        with spool_frames(reader, Progress()) as store:
            modes = learn_modes(store, displacements[::8], segments, metric, ids)
        assert modes.converged
        assert all(share >= KEEP for share in modes.kept.values())
        np.testing.assert_allclose((modes.weights**2).mean(axis=0), 1.0, rtol=1e-5)
        made = np.einsum("fr,rnd->fnd", modes.weights, modes.fields)
        left = ((made - displacements) ** 2).sum() / (displacements**2).sum()
        assert left < 2 * (1 - KEEP)


def test_flat_triangles_do_no_harm(tmp_path: Path) -> None:
    mesh = surface()
    mesh.vertices[SIDE - 2 : SIDE] = mesh.vertices[SIDE - 1]
    mesh.vertices[2 * SIDE - 2 : 2 * SIDE] = mesh.vertices[SIDE - 1]
    reader = reader_of(sequence_of(moving(mesh, 20), mesh, tmp_path / "a.npz"))
    displacements = reader.read(0, 20)
    metric = local_metric(mesh.vertices, mesh.triangles(), (displacements**2).sum(axis=2).mean(axis=0))
    assert metric.min() > 0
    with spool_frames(reader, Progress()) as store:
        modes = learn_modes(store, displacements, whole_face(256), metric, np.arange(256))
    assert np.isfinite(modes.fields).all()


def test_as_many_dimensions_as_asked_for(tmp_path: Path) -> None:
    mesh = surface()
    reader = reader_of(sequence_of(moving(mesh, 40), mesh, tmp_path / "a.npz"))
    displacements = reader.read(0, 40)
    ids = np.arange(len(mesh.vertices))
    metric = np.full(len(ids), 1.0 / len(ids), dtype=np.float32)
    with spool_frames(reader, Progress()) as store:
        modes = learn_modes(store, displacements, halves(len(ids)), metric, ids, 7)
    assert len(modes.names) == len(modes.fields) == 7
    assert set(modes.regions) == {"lower", "upper"}


def test_region_at_rest_has_no_modes(tmp_path: Path) -> None:
    mesh = surface()
    frames = moving(mesh, 30)
    low = np.arange(len(mesh.vertices)) < 5 * SIDE
    frames[:, ~low] = mesh.vertices[~low]
    reader = reader_of(sequence_of(frames, mesh, tmp_path / "a.npz"))
    displacements = reader.read(0, 30)
    metric = local_metric(mesh.vertices, mesh.triangles(), (displacements**2).sum(axis=2).mean(axis=0))
    with spool_frames(reader, Progress()) as store:
        for n_dimensions in (None, 3):
            modes = learn_modes(store, displacements, halves(256), metric, np.arange(256), n_dimensions)
            assert set(modes.regions) == {"lower"}
            assert modes.weights.shape == (30, len(modes.names))
