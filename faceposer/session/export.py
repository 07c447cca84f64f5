"""Writes the posed face as other programs read it."""

from pathlib import Path

from numpy.typing import ArrayLike

from faceposer.geometry.mesh import VertexNormals
from faceposer.geometry.obj_io import write_obj
from faceposer.geometry.polygon_mesh import Group
from faceposer.model.face_model import FaceModel


def write_posed_obj(path: Path, model: FaceModel, coefficients: ArrayLike) -> None:
    """Write the face with ``coefficients``, shape (r,), as OBJ, with the faces, UVs and groups that the character has.

    A character from a file of its own goes back in the unit, the axes and the order of that file.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    subject = model.subject
    vertices = model.instance(coefficients)
    normals = VertexNormals(subject.triangles, len(vertices))(vertices)
    comment = " ".join(f"Face Poser: {subject.title}. {subject.credits}".split())
    origin = subject.origin
    if origin is None:
        groups = [Group(part.name, part.polygons, part.material) for part in subject.parts]
        write_obj(path, vertices, subject.polygons, subject.uv, subject.polygon_uvs, normals, groups, comment)
        return
    has_uvs = len(origin.polygon_uvs) > 0
    write_obj(
        path,
        origin.vertices_of(vertices - subject.vertices),
        origin.polygons,
        origin.uv if has_uvs else None,
        origin.polygon_uvs if has_uvs else None,
        origin.normals_of(normals),
        origin.groups,
        comment,
    )
