"""The outside peers of the extra "bench": what they find, and what is said where they are not installed."""

import importlib.util
import sys

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.evaluation.methods.handles import Handles
from faceposer.evaluation.methods.method import prepared
from faceposer.evaluation.methods.registry import METHODS
from faceposer.evaluation.setting import StudyContext
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.character_file import load_character
from faceposer.solve.constraints.point import PointConstraint
from faceposer.training.capture import Capture

PACKAGES = {"eos": "eos", "arap": "igl"}
PEERS = [
    pytest.param(
        name,
        marks=pytest.mark.skipif(
            importlib.util.find_spec(package) is None, reason=f"{package} is not installed: faceposer[bench]"
        ),
    )
    for name, package in PACKAGES.items()
]
# Around the mouth and on the brows.
FEATURES = ("8.3", "8.4", "2.1", "8.1", "8.2", "4.1", "4.2")


@pytest.fixture(scope="module")
def setting():
    weights = np.random.default_rng(0).uniform(0.0, 0.6, (80, len(ARKIT_SHAPES)))
    return StudyContext.of(load_character("low"), [Capture(ARKIT_SHAPES, weights)])


def points(setting, strength, anchors=None):
    """Points that lie where the jaw opens by ``strength``."""
    character = setting.character
    weights = np.zeros(len(character.shapes))
    weights[character.shape_names.index("jawOpen")] = strength
    truth = setting.vertices_of(weights)
    anchors = anchors or [character.feature_points[name] for name in FEATURES]
    pixels = setting.camera.project(SurfacePoints.of(anchors).positions(truth, character.triangles))
    return [PointConstraint(a, (float(u), float(v)), setting.camera) for a, (u, v) in zip(anchors, pixels, strict=True)]


@pytest.mark.parametrize("name", PEERS)
def test_a_peer_opens_the_jaw_where_points_say_so(setting, name):
    method = prepared(METHODS[name], setting)
    character = setting.character
    vertices = np.asarray(method.vertices(method.solve(points(setting, 0.5))))
    assert vertices.shape == character.vertices.shape
    assert np.isfinite(vertices).all()
    chin, crown = character.feature_points["2.1"], character.feature_points["11.4"]
    wanted = character.shapes[character.shape_names.index("jawOpen"), chin] * 0.5
    moved = vertices[chin] - character.vertices[chin]
    # How far back the jaw turns is not to be seen from the front: only who knows expressions knows it.
    assert moved[1] < 0.5 * wanted[1] < 0.0
    assert np.linalg.norm(vertices[crown] - character.vertices[crown]) < 0.1 * np.linalg.norm(moved)


def test_eos_leaves_a_face_alone_whose_points_are_where_they_are(setting):
    pytest.importorskip("eos", reason="eos is not installed: faceposer[bench]")
    method = prepared(METHODS["eos"], setting, base="neutral")
    triangle = SurfacePoint(int(np.flatnonzero((setting.character.triangles == 100).any(axis=1))[0]), (0.2, 0.5, 0.3))
    found = method.solve(points(setting, 0.0, [triangle, 100]))
    np.testing.assert_allclose(method.vertices(found), setting.character.vertices, atol=2e-3)


def test_handles_meet_their_targets(setting):
    corner = int(setting.character.triangles[40, 2])
    inside = SurfacePoint(40, (0.2, 0.1, 0.7))
    given = points(setting, 0.4, [inside, setting.character.feature_points["8.3"]])
    handles = Handles.of(setting.character, given)
    assert handles.vertices.tolist() == [corner, setting.character.feature_points["8.3"]]
    moved = handles.places + handles.displacements()
    np.testing.assert_allclose(setting.camera.project(moved), [point.target for point in given], atol=1e-9)
    depths = [setting.camera.to_camera(places)[:, 2] for places in (handles.places, moved)]
    np.testing.assert_allclose(*depths)


def test_as_rigid_as_possible_holds_the_scalp_and_meets_its_handles(setting):
    pytest.importorskip("igl", reason="igl is not installed: faceposer[bench]")
    method = prepared(METHODS["arap"], setting)
    given = points(setting, 0.5)
    vertices = np.asarray(method.vertices(method.solve(given)))
    ids = [point.anchor for point in given]
    np.testing.assert_allclose(setting.camera.project(vertices[ids]), [p.target for p in given], atol=1e-6)
    motion = np.linalg.norm(setting.character.shapes, axis=2).max(axis=0)
    np.testing.assert_allclose(vertices[motion == 0.0], setting.character.vertices[motion == 0.0], atol=1e-6)


@pytest.mark.parametrize(("name", "package"), PACKAGES.items())
def test_without_its_package_a_peer_says_how_to_get_it(setting, monkeypatch, name, package):
    monkeypatch.setitem(sys.modules, package, None)
    assert {"mfa", "ppca", name} <= METHODS.keys()
    with pytest.raises(FacePoserError, match=r"pip install 'faceposer\[bench\]'"):
        prepared(METHODS[name], setting)
