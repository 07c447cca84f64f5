"""Writes the posed face as other programs read it."""

from pathlib import Path

from numpy.typing import ArrayLike

from faceposer.geometry.mesh import VertexNormals
from faceposer.geometry.obj_io import write_obj
from faceposer.geometry.polygon_mesh import Group
from faceposer.model.face_model import FaceModel


def write_posed_obj(path: Path, model: FaceModel, coefficients: ArrayLike) -> None:
    """Write the face with ``coefficients``, shape (r,), as OBJ: vertices, faces, UVs and parts exactly the subject's.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    subject = model.subject
    vertices = model.instance(coefficients)
    write_obj(
        path,
        vertices,
        subject.polygons,
        subject.uv,
        subject.polygon_uvs,
        VertexNormals(subject.triangles, len(vertices))(vertices),
        [Group(part.name, part.polygons, part.material) for part in subject.parts],
        f"Face Poser: {subject.title}. {subject.credits}",
    )
