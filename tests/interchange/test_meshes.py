"""The exported OBJ is the solver's face with the subject's topology."""

from pathlib import Path

import numpy as np

from faceposer.geometry.mesh_io import read_mesh
from faceposer.model.face_model import FaceModel
from faceposer.interchange.meshes import write_posed_obj


def test_obj_is_the_posed_face(model: FaceModel, tmp_path: Path) -> None:
    pose = model.coefficients_of({"jawOpen": 0.5, "mouthSmileLeft": 1.0})
    write_posed_obj(tmp_path / "pose.obj", model, pose)
    mesh, subject = read_mesh(tmp_path / "pose.obj"), model.subject
    height = np.ptp(subject.vertices[:, 1])
    assert np.abs(mesh.vertices - model.instance(pose)).max() < 1e-5 * height
    np.testing.assert_array_equal(mesh.polygons, subject.polygons)
    np.testing.assert_array_equal(mesh.polygon_uvs, subject.polygon_uvs)
    np.testing.assert_allclose(mesh.uv, subject.uv, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-3)
    text = (tmp_path / "pose.obj").read_text()
    for part in subject.parts:
        assert f"\ng {part.name}\nusemtl {part.material}\n" in text
