"""Scans and their landmarks from files."""

import json
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.alignment import Similarity
from faceposer.geometry.mesh import TriangleMesh
from faceposer.geometry.nearest_surface import NearestSurface
from faceposer.identity.scans.basis import HeadBasis
from faceposer.identity.scans.landmarks_file import read_scan_landmarks
from faceposer.identity.scans.scan import composed
from faceposer.identity.scans.simplifying import simplified
from faceposer.landmarks.reading import read_painted
from faceposer.landmarks.reference import reference
from faceposer.model.character_file import load_character
from tests.identity.meshes import ELSEWHERE

FAR = [*reference().places[:3].tolist(), [1e9, 0.0, 0.0], *reference().places[4:].tolist()]


def landmarks_file(path: Path, **changes: object) -> Path:
    """Write landmarks of the man elsewhere, with the feature point of his left mouth corner."""
    man = load_character("man")
    corner = man.vertices[man.feature_points["8.3"]].astype(np.float64)
    points = [place.tolist() for place in ELSEWHERE.apply(reference().places)]
    points[7] = None
    data = {
        "format": "faceposer.landmarks",
        "version": 1,
        "source": "me.obj",
        "kind": "mesh",
        "score": 1.0,
        "points": points,
        "feature_points": {"8.3": {"place": ELSEWHERE.apply(corner[None])[0].tolist()}},
    }
    path.write_text(json.dumps({**data, **changes}))
    return path


def test_landmarks_are_read(tmp_path: Path) -> None:
    found = read_scan_landmarks(landmarks_file(tmp_path / "a.json"))
    assert np.isnan(found.points[7]).all()
    np.testing.assert_allclose(found.points[8], ELSEWHERE.apply(reference().places)[8])
    # It lies where the points imply, so that it says nothing new.
    assert not found.features


def test_a_feature_point_that_was_moved_counts(tmp_path: Path) -> None:
    place = ELSEWHERE.apply(load_character("man").vertices[load_character("man").feature_points["8.3"]][None] + 0.5)[0]
    found = read_scan_landmarks(landmarks_file(tmp_path / "a.json", feature_points={"8.3": {"place": place.tolist()}}))
    np.testing.assert_allclose(found.features["8.3"], place)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"kind": "photo"}, "landmarks of a photo"),
        ({"points": [[0.0, 0.0, 0.0]] * 3}, "468"),
        ({"points": [[0.0, 0.0, 0.0]] * 468}, "fewer than three points"),
        ({"format": "faceposer.pins"}, "faceposer.landmarks"),
        (
            {"points": [[1e300, 0.0, 0.0]] * 468},
            r"points\[0\]\[0\] must be a number from -1e\+12 to 1e\+12, not 1e\+300",
        ),
        ({"points": [[1e-150 * i, 1e-150 * i * i, 0.0] for i in range(468)]}, "fewer than three points"),
        ({"spread": [1e300] * 468}, r"spread\[0\] must be a number from -1e\+12 to 1e\+12, not 1e\+300"),
        ({"feature_points": {"8.3": {"place": [0, 0, 10**13]}}}, r"place\[2\] must be a number from -1e\+12"),
        (
            {"feature_points": {"8.3": {"place": [0, 0, 10**9]}}},
            r"feature_points\.8\.3\.place is far away from the other",
        ),
        ({"points": FAR}, r"points\[3\] is far away from the other points; move it to the face, or remove it"),
    ],
)
def test_other_files_are_refused(tmp_path: Path, changes: dict[str, object], message: str) -> None:
    with pytest.raises(FacePoserError, match=message):
        read_scan_landmarks(landmarks_file(tmp_path / "a.json", **changes))


def test_colours_of_vertices_are_read(tmp_path: Path) -> None:
    obj, ply = tmp_path / "a.obj", tmp_path / "a.ply"
    obj.write_text("v 0 0 0 1 0 0\nv 1 0 0 0 0.5 0\nv 0 1 0 0 0 1\nf 1 2 3\n")
    properties = "".join(f"property float {name}\n" for name in "xyz")
    properties += "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
    rows = "0 0 0 255 0 0\n1 0 0 0 128 0\n0 1 0 0 0 255\n3 0 1 2\n"
    faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    ply.write_text(f"ply\nformat ascii 1.0\nelement vertex 3\n{properties}{faces}{rows}")
    expected = np.array([[255.0, 0.0, 0.0], [0.0, 127.5, 0.0], [0.0, 0.0, 255.0]])
    for path in (obj, ply):
        np.testing.assert_allclose(read_painted(str(path)).colours, expected, atol=0.6)


def test_simplified_meshes_stay_on_the_surface(basis: HeadBasis) -> None:
    mesh = TriangleMesh(basis.mean, basis.triangles)
    assert simplified(mesh, 20_000) is mesh
    coarse = simplified(mesh, 3000)
    assert 1000 < len(coarse.vertices) <= 3000
    assert len(coarse.triangles) > len(coarse.vertices)
    _, distances = NearestSurface(basis.mean, basis.triangles, np.arange(len(basis.triangles))).points(
        np.asarray(coarse.vertices)
    )
    # Two sheets in one cell, as of the ears, become one between them.
    assert np.quantile(distances, 0.95) < 0.5


def test_similarities_are_composed() -> None:
    other = Similarity(ELSEWHERE.rotation.T, np.array([1.0, 2.0, 3.0]), np.array(0.5))
    places = np.random.default_rng(0).normal(size=(4, 3))
    np.testing.assert_allclose(composed(other, ELSEWHERE).apply(places), other.apply(ELSEWHERE.apply(places)))
