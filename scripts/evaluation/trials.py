"""Tests made from an unseen take: constraints that a frame gives, and the frame itself."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from faceposer.geometry.camera import Camera
from faceposer.geometry.mesh import VertexNormals
from faceposer.geometry.picking import SurfacePoint, pick
from faceposer.model.face_model import FaceModel
from faceposer.model.subject import Subject
from faceposer.solve.constraints.point import PointConstraint

MOVES_PX = 1.0
Anchors = list[tuple[int, SurfacePoint]]

#: The subject's regions that make up each region of the judgement; together they are the face without ears and neck.
FACE_REGIONS: dict[str, tuple[str, ...]] = {
    "brows": ("brow_left", "brow_right", "forehead"),
    "lids": ("lids_left", "lids_right", "eye_left", "eye_right"),
    "midface": ("nose", "cheek_left", "cheek_right"),
    "mouth": ("mouth", "lip_upper", "lip_lower", "jaw"),
}


@dataclass(frozen=True)
class Trial:
    """One test.

    Attributes:
        constraints: What the method sees.
        truth: Vertices of the frame that the constraints come from, shape (N, 3).
        neutral_error: Mean distance of these from the neutral face.
    """

    constraints: list[PointConstraint]
    truth: np.ndarray
    neutral_error: float


def region_vertices(subject: Subject) -> dict[str, np.ndarray]:
    """Return the vertex ids of each of ``FACE_REGIONS``, each shape (n,)."""
    return {
        name: np.unique(np.concatenate([subject.regions[part] for part in parts]))
        for name, parts in FACE_REGIONS.items()
    }


def visible_anchors(model: FaceModel, camera: Camera, step: int = 3, among: Collection[int] | None = None) -> Anchors:
    """Return every ``step``-th vertex of the skin that the camera sees on the neutral face, with its point.

    Args:
        model: The face.
        camera: Sees it.
        step: How many of the vertices that face the camera are passed over.
        among: The only vertices to look at, if given.
    """
    subject = model.subject
    vertices = subject.vertices
    skin = subject.part("skin")
    normals = VertexNormals(subject.triangles, len(vertices))(vertices)
    facing = np.einsum("nd,nd->n", normals, camera.center - vertices) > 0.2 * np.linalg.norm(camera.center)
    candidates = [v for v in range(*skin.vertices) if facing[v]][::step]
    if among is not None:
        candidates = [v for v in candidates if v in among]
    # Only triangles of the front can hide a point that faces the camera.
    front = subject.triangles[facing[subject.triangles].any(axis=1)]
    anchors = []
    for vertex, pixel in zip(candidates, camera.project(vertices[candidates]).tolist(), strict=True):
        hit = pick(vertices, front, camera, (pixel[0], pixel[1]))
        if hit is not None and np.linalg.norm(vertices[front[hit.face]] - vertices[vertex], axis=1).min() < 0.5:
            anchors.append((vertex, SurfacePoint.at_vertex(subject.triangles, vertex)))
    return anchors


def make_trials(
    model: FaceModel,
    frames: np.ndarray,
    camera: Camera,
    anchors: Anchors,
    count: int,
    noise_px: float,
    poses: int,
    seed: Sequence[int],
    enough: int = 100,
) -> list[Trial]:
    """Return ``poses`` trials of ``count`` points each, from frames in which at least ``enough`` anchors move.

    Args:
        model: The face.
        frames: Rig weights of the unseen take, shape (F, S).
        camera: View in which the constraints are given.
        anchors: Vertices to choose from: only those that move by more than ``MOVES_PX`` in a frame become constraints.
        count: Points of each trial.
        noise_px: Standard deviation of the targets.
        poses: Number of trials at most.
        seed: Of frames, points and noise.
        enough: How many anchors must move for a frame to be taken.
    """
    rng = np.random.default_rng(seed)
    subject = model.subject
    vertex_ids = np.array([vertex for vertex, _ in anchors])
    rest = camera.project(subject.vertices[vertex_ids])
    trials: list[Trial] = []
    for frame in rng.permutation(len(frames)):
        truth = subject.vertices + np.tensordot(frames[frame].astype(np.float32), subject.shapes, axes=1)
        pixels = camera.project(truth[vertex_ids])
        moving = np.flatnonzero(np.hypot(*(pixels - rest).T) > MOVES_PX)
        if len(moving) < max(enough, count):
            continue
        chosen = rng.choice(moving, count, replace=False)
        targets = pixels[chosen] + noise_px * rng.standard_normal((count, 2))
        constraints = [
            PointConstraint(anchors[i][1], (float(u), float(v)), camera)
            for i, (u, v) in zip(chosen, targets, strict=True)
        ]
        neutral_error = float(np.linalg.norm(truth - subject.vertices, axis=1).mean())
        trials.append(Trial(constraints, truth, neutral_error))
        if len(trials) == poses:
            break
    return trials
