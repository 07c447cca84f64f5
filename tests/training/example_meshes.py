"""A small face-like surface that moves in a few ways, for tests of learning from meshes."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from faceposer.geometry.mesh_sequence import MeshSequence, frames_of, write_frames
from faceposer.geometry.polygon_mesh import PolygonMesh
from faceposer.progress import Progress
from faceposer.training.frames import AlignedReader, sample_of, steady_vertices

Array = NDArray[np.float64]
SIDE = 16


def surface() -> PolygonMesh:
    """Return a bulging grid of quads."""
    x, y = np.meshgrid(np.linspace(-6, 6, SIDE), np.linspace(-8, 8, SIDE))
    vertices = np.stack([x, y, 9.0 - 0.08 * (x**2 + y**2)], axis=-1).reshape(-1, 3)
    ids = np.arange(SIDE * SIDE).reshape(SIDE, SIDE)
    corners = [ids[:-1, :-1], ids[:-1, 1:], ids[1:, 1:], ids[1:, :-1]]
    return PolygonMesh(vertices, np.stack(corners, axis=-1).reshape(-1, 4).astype(np.int32))


def fields(vertices: Array, count: int = 6) -> Array:
    """Return movements of round patches, (count, N, 3); the upper rim and the sides stay."""
    rng = np.random.default_rng(3)
    middles = np.stack([rng.uniform(-3, 3, count), rng.uniform(-5, 3, count)], axis=1)
    reach = np.exp(-((vertices[None, :, :2] - middles[:, None]) ** 2).sum(axis=2) / 4.0)
    return reach[:, :, None] * rng.standard_normal((count, 1, 3))


def moving(mesh: PolygonMesh, n_frames: int, count: int = 6, seed: int = 0) -> Array:
    """Return ``n_frames`` of ``mesh`` in motion, (F, N, 3), the head held still."""
    rng = np.random.default_rng(seed)
    weights = rng.standard_normal((n_frames, count)) * (0.7 ** np.arange(count))
    return mesh.vertices + np.einsum("fk,knd->fnd", weights, fields(mesh.vertices, count))


def shaken(frames: Array, seed: int = 1) -> Array:
    """Return ``frames`` with another rigid motion of each."""
    rng = np.random.default_rng(seed)
    turns = Rotation.from_rotvec(0.2 * rng.standard_normal((len(frames), 3))).as_matrix()
    return frames @ np.swapaxes(turns, 1, 2) + 3.0 * rng.standard_normal((len(frames), 1, 3))


def sequence_of(frames: Array, mesh: PolygonMesh, path: Path) -> MeshSequence:
    """Return ``frames`` as a sequence that reads them from ``path``."""
    write_frames(path, frames, len(frames), len(mesh.vertices))
    return frames_of(path, mesh, "the neutral")


def reader_of(sequence: MeshSequence) -> AlignedReader:
    """Return a reader that aligns by what moves least."""
    _, sample = sample_of(sequence, Progress())
    return AlignedReader(sequence, steady_vertices(sample, sequence.neutral.vertices))
