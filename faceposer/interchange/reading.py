"""Importers: poses and performances of a face from posed meshes and weights of other programs."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.files.sample_rates import USUAL_RATE
from faceposer.files.sample_times import assumed_rate
from faceposer.geometry.alignment import determines_rotation, rigid_alignment
from faceposer.geometry.mesh_io import POSED_MESH_SUFFIXES, read_mesh
from faceposer.geometry.polygon_mesh import PolygonMesh
from faceposer.model.face_model import FaceModel
from faceposer.model.name_matching import match_with_ties
from faceposer.model.performance import Performance
from faceposer.model.sampling import resampled
from faceposer.model.shape_names import half_shapes_of, whole_shape_of
from faceposer.training.named_weights import NamedWeights
from faceposer.training.recordings import GLTF, WEIGHTS, read_named

Array = NDArray[np.float64]

# Millimetres per unit of a mesh.
_MILLIMETRES = 10.0
# Largest error that is invisible, in millimetres.
_INVISIBLE_ERROR = 0.01
# Root mean square error, in millimetres, above which a rigid motion of the mesh is estimated.
_ALIGNMENT_ERROR = 1.0
_MAX_ITERATIONS, _TOLERANCE = 200, 1e-5
# Largest root mean square error of a mesh that is a pose of the face, as a share of the head's height.
_MAX_ERROR = 0.05
_MIRROR = np.array([-1.0, 1.0, 1.0])


@dataclass(frozen=True, eq=False)
class ReadPose:
    """A pose from a file.

    Attributes:
        coefficients: The pose, shape (r,).
        note: Remark on the quality of the fit, for the user.
        frames: Number of frames in the file.
    """

    coefficients: Array
    note: str
    frames: int = 1


@dataclass(frozen=True, eq=False)
class ReadPerformance:
    """A performance from a file.

    Attributes:
        performance: Its poses.
        note: Remark on shapes that were ignored, for the user, or "".
    """

    performance: Performance
    note: str


def read_pose(path: Path, model: FaceModel, frame: int = 0) -> ReadPose:
    """Read a pose from a mesh of the character's topology (.obj, .ply), or from a frame of weights (``WEIGHTS``).

    Args:
        path: The file.
        model: The face.
        frame: Frame of the weights, from 0.

    Raises:
        FacePoserError: If the file cannot be read, belongs to another face, or has no such frame.
    """
    suffix = path.suffix.lower()
    if suffix in POSED_MESH_SUFFIXES:
        return pose_of_mesh(read_mesh(path), model, str(path))
    if suffix not in WEIGHTS:
        raise FacePoserError(
            f"'{path}' is not a pose; give a file that ends in one of {', '.join(POSED_MESH_SUFFIXES + WEIGHTS)}."
        )
    read = read_performance(path, model)
    count = len(read.performance)
    if not 0 <= frame < count:
        frames = "a single frame" if count == 1 else f"the frames 1 to {count}"
        raise FacePoserError(f"'{path}' has {frames}, but no frame {frame + 1}.")
    position = f"Frame {frame + 1} of {count}. " if count > 1 else ""
    return ReadPose(read.performance.coefficients[frame], (position + read.note).strip(), count)


def pose_of_mesh(mesh: PolygonMesh, model: FaceModel, name: str) -> ReadPose:
    """Return the pose of the face closest to ``mesh``, in the least squares of the distances of its vertices.

    For an imported character, the vertices are in the unit, axes and order of its original file. A mesh that was moved,
    rotated or scaled as a whole is first aligned with the face.

    Args:
        mesh: The posed mesh.
        model: The face.
        name: Name of the mesh in messages.

    Raises:
        FacePoserError: If the mesh has another topology or is not a pose of this face.
    """
    character, origin = model.character, model.character.origin
    n_vertices = len(character.vertices) if origin is None else len(origin.neutral)
    if len(mesh.vertices) != n_vertices:
        raise FacePoserError(
            f"'{name}' has {counted(len(mesh.vertices), 'vertex', 'vertices')}, but {character.title} has "
            f"{n_vertices}; give a mesh that was exported from this face, without adding, merging or removing vertices."
        )
    vertices = mesh.vertices
    if origin is not None:
        vertices = character.vertices + origin.character_vertices(mesh.vertices, len(character.vertices))
    fit = _PoseFit(model)
    coefficients, errors = fit.nearest(vertices)
    mean_error = _root_mean_square(errors)
    is_aligned = False
    if _MILLIMETRES * mean_error > _ALIGNMENT_ERROR and determines_rotation(vertices):
        aligned, aligned_errors = fit.aligned(vertices)
        is_aligned = _root_mean_square(aligned_errors) < 0.5 * mean_error
        if is_aligned:
            coefficients, errors, mean_error = aligned, aligned_errors, _root_mean_square(aligned_errors)
    is_mirrored = False
    # The mirror image of a flat face is near to it.
    if _MILLIMETRES * mean_error > _ALIGNMENT_ERROR and determines_rotation(vertices):
        aligned, aligned_errors = fit.aligned(vertices * _MIRROR)
        is_mirrored = _root_mean_square(aligned_errors) < min(0.5 * mean_error, _MAX_ERROR * character.height)
        if is_mirrored:
            coefficients, errors, mean_error = aligned, aligned_errors, _root_mean_square(aligned_errors)
            is_aligned = False
    max_error = float(errors.max())
    if mean_error > _MAX_ERROR * character.height:
        raise FacePoserError(
            f"'{name}' is not a pose of {character.title}: the mean error is {_MILLIMETRES * mean_error:.0f} mm; "
            "export the mesh with its original vertex order."
        )
    note = f"Mean error to the mesh {_MILLIMETRES * mean_error:.2f} mm, maximum {_MILLIMETRES * max_error:.2f} mm."
    if _MILLIMETRES * max_error < _INVISIBLE_ERROR:
        note = "The pose matches the mesh exactly."
    if is_mirrored:
        note += " The mesh is mirrored; it was mirrored back."
    if is_aligned:
        note += " The mesh was moved, rotated or scaled as a whole; it was aligned with the face by all its vertices."
    return ReadPose(coefficients, note)


class _PoseFit:
    """Least squares fit of poses to vertices."""

    def __init__(self, model: FaceModel) -> None:
        self._model = model
        self._basis: Array = model.basis.astype(np.float64)
        self._factor = np.linalg.inv(self._basis @ self._basis.T)

    def nearest(self, vertices: Array) -> tuple[Array, Array]:
        """Return the pose closest to ``vertices``, (N, 3), as (r,), and the error of each vertex, (N,)."""
        flat = (vertices - self._model.character.vertices).ravel()
        coefficients: Array = self._factor @ (self._basis @ flat)
        return coefficients, np.linalg.norm((flat - coefficients @ self._basis).reshape(-1, 3), axis=1)

    def aligned(self, vertices: Array) -> tuple[Array, Array]:
        """Return the same after the rotation, scaling and translation that bring ``vertices`` closest to a pose.

        Alternates between the alignment with the current pose and the fit of the pose until it converges.
        """
        face = self._model.character.vertices.astype(np.float64)
        coefficients, errors = self._model.neutral(), np.zeros(len(face))
        for _ in range(_MAX_ITERATIONS):
            aligned = rigid_alignment(vertices, face, scale=True).apply(vertices)
            previous, (coefficients, errors) = coefficients, self.nearest(aligned)
            face = self._model.instance(coefficients).astype(np.float64)
            if np.abs(coefficients - previous).max() < _TOLERANCE * max(np.abs(coefficients).max(), 1.0):
                break
        return coefficients, errors


def _root_mean_square(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))


def read_performance(path: Path, model: FaceModel, rate: float | None = None) -> ReadPerformance:
    """Read a performance from weights: a take (.csv, .txt), weights as .json, or the morph targets of glTF.

    Shapes that the file lacks have the weight 0; shapes that the character lacks are ignored. Samples are put on frames
    by their times; frames without a sample are interpolated.

    Args:
        path: The file.
        model: Model of the face.
        rate: Frames per second in place of those that the file states or its times give.

    Raises:
        FacePoserError: If the file cannot be read or has none of the character's shapes.
    """
    named = read_named(path, rate)
    title, shapes = model.character.title, model.character.shape_names
    # Other programs spell ARKit's names differently.
    names, spelling = _known_names(named.names, shapes)
    _check_spellings(path, named, names)
    weights = np.zeros((len(named.frames), len(shapes)))
    used: set[str] = set()
    absent = []
    for column, shape in enumerate(shapes):
        # A file may have a shape, the whole of a half shape, the halves of a whole shape, or all, which then add up.
        for group in ((shape,), {whole_shape_of(shape)} - {shape}, half_shapes_of(shape)):
            found = [names.index(name) for name in group if name in names]
            if found:
                weights[:, column] += named.frames[:, found].mean(axis=1)
                used.update(group)
        if not used.intersection((shape, whole_shape_of(shape), *half_shapes_of(shape))):
            absent.append(shape)
    if not used:
        raise FacePoserError(
            f"'{path}' has none of the shapes of {title} (the file has '{names[0][:60]}' etc., the face "
            f"'{shapes[0]}' etc.); give weights of this face."
        )
    ignored = len(set(names) - used)
    notes = [*named.notes, *([spelling] if spelling else [])]
    known = rate or named.rate
    if known is None and len(weights) > 1:
        notes.append(assumed_rate("It does not state a rate"))
    if absent and len(weights) > 1:
        notes.append(_absent_note(absent, len(shapes), title))
    if ignored:
        were = "was" if ignored == 1 else "were"
        notes.append(
            f"{ignored} of its {counted(len(names), 'shape')} {were} not read, because {title} does not have them."
        )
    if rate is not None and path.suffix.lower() in GLTF:
        # Keys of glTF are at seconds, which stay.
        performance = resampled(Performance.from_weights(model, weights, named.rate or rate), rate)
    else:
        performance = Performance.from_weights(model, weights, known or USUAL_RATE)
    return ReadPerformance(performance, " ".join(notes))


def _absent_note(absent: Sequence[str], count: int, title: str) -> str:
    listed = ", ".join(absent[:3]) + (f" and {len(absent) - 3} more" if len(absent) > 3 else "")
    return f"It has no weights of {len(absent)} of the {count} shapes of {title}, which stay at 0: {listed}."


def _known_names(names: Sequence[str], shapes: Sequence[str]) -> tuple[list[str], str]:
    """Return ``names`` with ARKit's names for those that are none of ``shapes``, and a note on how they were read."""
    match = match_with_ties(name for name in names if name not in shapes)
    known = match.with_ties
    return [known.get(name, name) for name in names], match.note


def _check_spellings(path: Path, named: NamedWeights, names: list[str]) -> None:
    """Raise FacePoserError if two columns of the same shape, by its canonical name in ``names``, differ."""
    first: dict[str, int] = {}
    for column, name in enumerate(names):
        other = first.setdefault(name, column)
        if other != column and not np.array_equal(named.frames[:, other], named.frames[:, column]):
            raise FacePoserError(
                f"'{path}' has the shape {name} twice with different weights, as '{named.names[other][:60]}' and "
                f"'{named.names[column][:60]}'; remove one of them."
            )
