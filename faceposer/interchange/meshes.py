"""The posed face as meshes that other programs read: OBJ and PLY, one file or a folder of numbered ones.

A character from a file of its own goes back in the unit, the axes and the order of that file.
"""

from collections.abc import Callable, Generator
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.files.atomic import atomic_folder
from faceposer.geometry.mesh import VertexNormals
from faceposer.geometry.obj_io import ObjWriter
from faceposer.geometry.ply_io import write_ply
from faceposer.geometry.polygon_mesh import Group
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.progress import Progress

SequenceKind = Literal["obj", "ply"]

_WriteFrame = Callable[[Path, NDArray[np.floating]], None]


def write_posed_obj(path: Path, model: FaceModel, coefficients: ArrayLike, contact: bool = True) -> None:
    """Write the face with ``coefficients``, shape (r,), as OBJ, with the faces, UVs and groups that the character has.

    With ``contact`` it is written after the contact step, as the window shows it.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    _obj_frames(model)(path, model.surface(coefficients, contact))


def write_posed_ply(path: Path, model: FaceModel, coefficients: ArrayLike, contact: bool = True) -> None:
    """Write the face with ``coefficients``, shape (r,), as binary PLY with normals and the faces of the character.

    With ``contact`` it is written after the contact step, as the window shows it.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    _ply_frames(model)(path, model.surface(coefficients, contact))


def write_sequence(
    folder: Path,
    model: FaceModel,
    performance: Performance,
    kind: SequenceKind = "obj",
    progress: Progress | None = None,
    contact: bool = True,
) -> list[Path]:
    """Write every frame of ``performance`` as a mesh of its own, as ``sequence_steps`` does, and return the files.

    Raises:
        FacePoserError: If the folder holds something or cannot be written.
    """
    for share in sequence_steps(folder, model, performance, kind, contact):
        (progress or Progress()).at("Writing", share)
    return sorted(folder.iterdir())


def sequence_steps(
    folder: Path, model: FaceModel, performance: Performance, kind: SequenceKind = "obj", contact: bool = True
) -> Generator[float, None, None]:
    """Write every frame of ``performance`` as a mesh of its own into ``folder``, which must be new or empty.

    The files are called by the folder and the number of the frame, from 1, such as smile.0001.obj; after each, the
    share that is done is told. The folder appears when all are written; if the iterator is closed before, not at all.
    With ``contact`` the meshes are written after the contact step.

    Raises:
        FacePoserError: If the folder holds something or cannot be written.
    """
    write = {"obj": _obj_frames, "ply": _ply_frames}[kind](model)
    digits = max(4, len(str(len(performance))))
    with atomic_folder(folder) as temporary:
        for number, pose in enumerate(performance.coefficients, 1):
            write(temporary / f"{folder.name}.{number:0{digits}}.{kind}", model.surface(pose, contact))
            yield number / len(performance)


def _obj_frames(model: FaceModel) -> _WriteFrame:
    """Return what writes the subject's vertices, (N, 3), as OBJ."""
    subject = model.subject
    origin = subject.origin
    normals = VertexNormals(subject.triangles, len(subject.vertices))
    if origin is None:
        groups = [Group(part.name, part.polygons, part.material) for part in subject.parts]
        whole = ObjWriter(subject.polygons, subject.uv, subject.polygon_uvs, True, groups, _comment(model))
        return lambda path, vertices: whole.write(path, vertices, normals(vertices))
    has_uvs = len(origin.polygon_uvs) > 0
    uv, polygon_uvs = (origin.uv, origin.polygon_uvs) if has_uvs else (None, None)
    writer = ObjWriter(origin.polygons, uv, polygon_uvs, True, origin.groups, _comment(model))
    return lambda path, vertices: writer.write(
        path, origin.vertices_of(vertices - subject.vertices), origin.normals_of(normals(vertices))
    )


def _ply_frames(model: FaceModel) -> _WriteFrame:
    """Return what writes the subject's vertices, (N, 3), as PLY."""
    subject, comment = model.subject, _comment(model)
    origin = subject.origin
    normals = VertexNormals(subject.triangles, len(subject.vertices))
    if origin is None:
        return lambda path, vertices: write_ply(path, vertices, subject.polygons, normals(vertices), comment)
    return lambda path, vertices: write_ply(
        path,
        origin.vertices_of(vertices - subject.vertices),
        origin.polygons,
        origin.normals_of(normals(vertices)),
        comment,
    )


def _comment(model: FaceModel) -> str:
    return " ".join(f"Face Poser: {model.subject.title}. {model.subject.credits}".split())
