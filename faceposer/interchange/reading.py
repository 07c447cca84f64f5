"""The way back in: posed meshes and weights of other programs become poses and performances of a face again."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh_io import read_mesh
from faceposer.geometry.polygon_mesh import PolygonMesh
from faceposer.interchange.live_link import rate_of_capture
from faceposer.interchange.weights_json import read_weights
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.training.capture import read_capture

Array = NDArray[np.float64]

MESHES = (".obj", ".ply")
WEIGHTS = (".csv", ".txt", ".json")
_MILLIMETRES = 10.0
_DEFAULT_RATE = 30.0
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
    """Return the pose in a mesh of the subject's topology (.obj, .ply), or in one frame of weights (.csv, .txt, .json).

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

    The vertices are those of the character's own file, in its unit, axes and order, where it came from one.

    Raises:
        FacePoserError: If the mesh, called ``name``, has another topology or is no pose of this face.
    """
    subject, origin = model.subject, model.subject.origin
    wanted = len(subject.vertices) if origin is None else len(origin.neutral)
    if len(mesh.vertices) != wanted:
        raise FacePoserError(
            f"'{name}' has {len(mesh.vertices)} vertices, and {subject.title} has {wanted}; give a mesh that was "
            "exported from this face, with no vertex added, merged or left out."
        )
    if origin is None:
        moved = mesh.vertices - subject.vertices
    else:
        moved = origin.subject_vertices(mesh.vertices, len(subject.vertices))
    basis: Array = model.basis.astype(np.float64)
    flat: Array = np.asarray(moved, dtype=np.float64).ravel()
    coefficients: Array = np.linalg.solve(basis @ basis.T, basis @ flat).astype(np.float64, copy=False)
    off = np.linalg.norm((flat - coefficients @ basis).reshape(-1, 3), axis=1)
    typical, most = float(np.sqrt((off**2).mean())), float(off.max())
    if typical > _MOST_OFF * subject.height:
        raise FacePoserError(
            f"'{name}' is no pose of {subject.title}: its vertices are {_MILLIMETRES * typical:.0f} mm off; export it "
            "in the unit, the axes, the place and the order of vertices that it had."
        )
    note = f"The pose is {_MILLIMETRES * typical:.2f} mm off the mesh, at most {_MILLIMETRES * most:.2f} mm."
    return ReadPose(coefficients, note)


def read_performance(path: Path, model: FaceModel) -> ReadPerformance:
    """Return the performance in weights: a take of Live Link Face or Face Cap (.csv, .txt), or our own .json.

    Shapes that the file lacks rest; shapes that the subject lacks are passed over.

    Raises:
        FacePoserError: If the file cannot be read or has none of the subject's shapes.
    """
    suffix = path.suffix.lower()
    if suffix not in WEIGHTS:
        raise FacePoserError(f"'{path}' is no animation; give weights that end in one of {', '.join(WEIGHTS)}.")
    if suffix == ".json":
        named = read_weights(path)
        names, frames, rate = named.names, named.frames, named.rate or _DEFAULT_RATE
    else:
        capture = read_capture(path)
        names, frames, rate = capture.shape_names, capture.weights, rate_of_capture(path)
    weights = np.zeros((len(frames), len(model.subject.shape_names)))
    used = set()
    for column, shape in enumerate(model.subject.shape_names):
        # A rig may have the halves of what the file has whole.
        name = shape if shape in names else shape.removesuffix("Left").removesuffix("Right")
        if name in names:
            weights[:, column] = frames[:, names.index(name)]
            used.add(name)
    if not used:
        raise FacePoserError(
            f"'{path}' has none of the shapes of {model.subject.title} (it has '{names[0][:60]}' and so on, the face "
            f"'{model.subject.shape_names[0]}'); give weights of this face."
        )
    left = len(names) - len(used)
    note = f"{left} of its {len(names)} shapes are none of {model.subject.title}'s and were left out." if left else ""
    return ReadPerformance(Performance.from_weights(model, weights, rate), note)
