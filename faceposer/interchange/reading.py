"""The way back in: posed meshes and weights of other programs become poses and performances of a face again."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.geometry.alignment import determines_rotation, rigid_alignment
from faceposer.geometry.mesh_io import read_mesh
from faceposer.geometry.polygon_mesh import PolygonMesh
from faceposer.interchange.gltf_weights import read_gltf_weights
from faceposer.interchange.live_link import rate_of_capture
from faceposer.interchange.named_weights import NamedWeights
from faceposer.interchange.weights_json import read_weights
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.model.shape_names import canonical_shape, halves_of, whole_of
from faceposer.training.capture import read_capture

Array = NDArray[np.float64]

MESHES = (".obj", ".ply")
WEIGHTS = (".csv", ".txt", ".json", ".glb", ".gltf")
_MILLIMETRES = 10.0
_DEFAULT_RATE = 30.0
# Millimetres that nobody sees.
_SAME = 0.01
# Of the root mean square: a mesh that is nearer than this has not been moved as a whole.
_WORTH_MOVING = 1.0
_MOST_ROUNDS, _SETTLED = 200, 1e-5
# Of the height of the head: a mesh that is off by more, in the root mean square, is another pose than this face has.
_MOST_OFF = 0.05


@dataclass(frozen=True, eq=False)
class ReadPose:
    """A pose from a file.

    Attributes:
        coefficients: Shape (r,).
        note: What the user should know of how well it came over, one sentence.
    """

    coefficients: Array
    note: str


@dataclass(frozen=True, eq=False)
class ReadPerformance:
    """A performance from a file, and what the user should know of how well it came over, one sentence or ""."""

    performance: Performance
    note: str


def read_pose(path: Path, model: FaceModel, frame: int = 0) -> ReadPose:
    """Return the pose in a mesh of the character's topology (.obj, .ply), or in one frame of weights (``WEIGHTS``).

    Args:
        path: The file.
        model: The face that is to take the pose.
        frame: Which frame of weights, from 0.

    Raises:
        FacePoserError: If the file cannot be read, is of another face, or has no such frame.
    """
    suffix = path.suffix.lower()
    if suffix in MESHES:
        return pose_of_mesh(read_mesh(path), model, str(path))
    if suffix not in WEIGHTS:
        raise FacePoserError(f"'{path}' is no pose; give a file that ends in one of {', '.join(MESHES + WEIGHTS)}.")
    read = read_performance(path, model)
    count = len(read.performance)
    if not 0 <= frame < count:
        frames = "a single frame" if count == 1 else f"the frames 1 to {count}"
        raise FacePoserError(f"'{path}' has {frames}, and not frame {frame + 1}.")
    which = f"Frame {frame + 1} of {count}. " if count > 1 else ""
    return ReadPose(read.performance.coefficients[frame], (which + read.note).strip())


def pose_of_mesh(mesh: PolygonMesh, model: FaceModel, name: str) -> ReadPose:
    """Return the pose of the face nearest to ``mesh``, in the least squares of the distances of its vertices.

    The vertices are those of the character's own file, in its unit, axes and order, where it came from one. A mesh that
    was moved, turned or scaled as a whole is first laid back on the face.

    Raises:
        FacePoserError: If the mesh, called ``name``, has another topology or is no pose of this face.
    """
    character, origin = model.character, model.character.origin
    wanted = len(character.vertices) if origin is None else len(origin.neutral)
    if len(mesh.vertices) != wanted:
        raise FacePoserError(
            f"'{name}' has {counted(len(mesh.vertices), 'vertex', 'vertices')}, and {character.title} has {wanted}; "
            "give a mesh that was exported from this face, with no vertex added, merged or left out."
        )
    vertices = mesh.vertices
    if origin is not None:
        vertices = character.vertices + origin.character_vertices(mesh.vertices, len(character.vertices))
    fit = _Fit(model)
    coefficients, off = fit.nearest(vertices)
    typical = _root_mean_square(off)
    moved = False
    if _MILLIMETRES * typical > _WORTH_MOVING and determines_rotation(vertices):
        laid, laid_off = fit.laid_back(vertices)
        moved = _root_mean_square(laid_off) < 0.5 * typical
        if moved:
            coefficients, off, typical = laid, laid_off, _root_mean_square(laid_off)
    most = float(off.max())
    if typical > _MOST_OFF * character.height:
        raise FacePoserError(
            f"'{name}' is no pose of {character.title}: its vertices are {_MILLIMETRES * typical:.0f} mm off; export "
            "it with the order of vertices that it had."
        )
    note = f"The pose is {_MILLIMETRES * typical:.2f} mm off the mesh, at most {_MILLIMETRES * most:.2f} mm."
    if _MILLIMETRES * most < _SAME:
        note = "The pose is that of the mesh."
    return ReadPose(coefficients, f"{note} The mesh was moved back onto the face." if moved else note)


class _Fit:
    """Finds the pose nearest to vertices."""

    def __init__(self, model: FaceModel) -> None:
        self._model = model
        self._basis: Array = model.basis.astype(np.float64)
        self._factor = np.linalg.inv(self._basis @ self._basis.T)

    def nearest(self, vertices: Array) -> tuple[Array, Array]:
        """Return the pose nearest to ``vertices``, (N, 3), as (r,), and how far off each of them stays, (N,)."""
        flat = (vertices - self._model.character.vertices).ravel()
        coefficients: Array = self._factor @ (self._basis @ flat)
        return coefficients, np.linalg.norm((flat - coefficients @ self._basis).reshape(-1, 3), axis=1)

    def laid_back(self, vertices: Array) -> tuple[Array, Array]:
        """Return the same for ``vertices`` after the turn, scale and shift that bring them nearest to a pose."""
        face = self._model.character.vertices.astype(np.float64)
        coefficients, off = self._model.neutral(), np.zeros(len(face))
        for _ in range(_MOST_ROUNDS):
            laid = rigid_alignment(vertices, face, scale=True).apply(vertices)
            before, (coefficients, off) = coefficients, self.nearest(laid)
            face = self._model.instance(coefficients).astype(np.float64)
            if np.abs(coefficients - before).max() < _SETTLED * max(np.abs(coefficients).max(), 1.0):
                break
        return coefficients, off


def _root_mean_square(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))


def read_performance(path: Path, model: FaceModel) -> ReadPerformance:
    """Return the performance in weights: of Live Link Face or Face Cap (.csv, .txt), our own .json, or glTF's targets.

    Shapes that the file lacks rest; shapes that the character lacks are passed over.

    Raises:
        FacePoserError: If the file cannot be read or has none of the character's shapes.
    """
    named = _read_named(path)
    title, shapes = model.character.title, model.character.shape_names
    # Other programs spell ARKit's names in their own ways.
    names = [name if name in shapes else canonical_shape(name) or name for name in named.names]
    _check_spellings(path, named, names)
    weights = np.zeros((len(named.frames), len(shapes)))
    used: set[str] = set()
    for column, shape in enumerate(shapes):
        # A file may have the whole of a half, the halves of a whole, or all of them, whose movements add up.
        for group in ((shape,), {whole_of(shape)} - {shape}, halves_of(shape)):
            found = [names.index(name) for name in group if name in names]
            if found:
                weights[:, column] += named.frames[:, found].mean(axis=1)
                used.update(group)
    if not used:
        raise FacePoserError(
            f"'{path}' has none of the shapes of {title} (it has '{names[0][:60]}' and so on, the face "
            f"'{shapes[0]}'); give weights of this face."
        )
    left = len(set(names) - used)
    note = f"{left} of its {len(names)} shapes are none of {title}'s and were left out." if left else ""
    return ReadPerformance(Performance.from_weights(model, weights, named.rate or _DEFAULT_RATE), note)


def _check_spellings(path: Path, named: NamedWeights, names: list[str]) -> None:
    """Refuse two spellings of one shape, as ``names`` has them understood, whose weights differ."""
    first: dict[str, int] = {}
    for column, name in enumerate(names):
        before = first.setdefault(name, column)
        if before != column and not np.array_equal(named.frames[:, before], named.frames[:, column]):
            raise FacePoserError(
                f"'{path}' has the shape {name} twice with different weights, as '{named.names[before][:60]}' and "
                f"'{named.names[column][:60]}'; leave one out."
            )


def _read_named(path: Path) -> NamedWeights:
    suffix = path.suffix.lower()
    if suffix not in WEIGHTS:
        raise FacePoserError(f"'{path}' is no animation; give weights that end in one of {', '.join(WEIGHTS)}.")
    if suffix == ".json":
        return read_weights(path)
    if suffix in (".glb", ".gltf"):
        return read_gltf_weights(path)
    capture = read_capture(path)
    return NamedWeights(capture.shape_names, capture.weights, rate_of_capture(path))
