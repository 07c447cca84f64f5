"""Distances between a scan and a head as linear functions of the unknowns."""

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.alignment import Similarity
from faceposer.geometry.mesh import TriangleMesh
from faceposer.identity.scan_surface import ScanSurface
from faceposer.identity.scans.basis import HeadBasis
from faceposer.identity.scans.equations import moved
from faceposer.identity.scans.residuals import Unknowns, from_scan
from faceposer.identity.template import head_template
from tests.identity.meshes import remeshed

_HERE = Similarity(np.eye(3), np.zeros(3), np.array(1.0))
_FEW = 6


@pytest.fixture(scope="module")
def surface(basis: HeadBasis) -> ScanSurface:
    """Return a scan of the mean head, on other vertices, some of them far away."""
    mesh = remeshed(basis.mean, head_template().quads)
    return ScanSurface.of(mesh)


@pytest.mark.parametrize("segments", [False, True])
def test_columns_across_the_surface_are_those_of_its_points(basis: HeadBasis, segments: bool) -> None:
    rng = np.random.default_rng(0)
    rows = basis.triangles[rng.integers(len(basis.triangles), size=20)].astype(np.int64)
    shares, normals = rng.dirichlet(np.ones(3), size=20), rng.normal(size=(20, 3))
    unknowns = Unknowns.of(basis, _FEW, segments, np.arange(3))
    expected = np.concatenate(unknowns.at(basis, rows, shares))
    found = unknowns.across(basis, rows, shares, normals)
    np.testing.assert_allclose(found, np.einsum("pmd,md->mp", expected, normals), atol=1e-12)


def test_steps_by_the_columns_find_coefficients_and_motion(basis: HeadBasis) -> None:
    wanted = np.array([0.5, -0.4, 0.3, 0.6, -0.5, 0.4])
    head = basis.mean + np.tensordot(wanted, basis.modes[:_FEW], 1)
    frame = moved(_HERE, np.array([0.01, -0.02, 0.01, 0.1, 0.05, -0.1, 0.01]))
    mesh = remeshed(head, head_template().quads)
    surface = ScanSurface.of(TriangleMesh(frame.inverse().apply(mesh.vertices), mesh.triangles))
    unknowns = Unknowns.of(basis, _FEW, False, np.arange(3))
    known, place = np.zeros(_FEW), _HERE
    for _ in range(5):
        current = basis.mean + np.tensordot(known, basis.modes[:_FEW], 1)
        rows = from_scan(basis, current, surface, place, unknowns, 0.001, 1.0)
        columns = np.delete(rows.columns, np.s_[_FEW:-7], axis=1)
        step, *_ = np.linalg.lstsq(columns, rows.values, rcond=None)
        known, place = known + step[:_FEW], moved(place, step[_FEW:])
    np.testing.assert_allclose(known, wanted, atol=0.03)
    there = place.apply(frame.inverse().apply(head))
    assert np.linalg.norm(there - head, axis=1).mean() < 0.02


def test_the_spread_is_that_of_the_distances(basis: HeadBasis) -> None:
    mesh = remeshed(basis.mean, head_template().quads)
    rng = np.random.default_rng(1)
    noisy = np.asarray(mesh.vertices) + rng.normal(scale=0.02, size=np.shape(mesh.vertices))
    unknowns = Unknowns.of(basis, _FEW, False, np.arange(3))
    rows = from_scan(
        basis, basis.mean, ScanSurface.of(TriangleMesh(noisy, mesh.triangles)), _HERE, unknowns, 0.001, 0.3
    )
    assert 0.015 < rows.spread < 0.025


def test_a_scan_elsewhere_is_refused(basis: HeadBasis, surface: ScanSurface) -> None:
    unknowns = Unknowns.of(basis, _FEW, False, np.arange(3))
    with pytest.raises(FacePoserError, match="does not match its landmarks"):
        from_scan(basis, basis.mean + 50.0, surface, _HERE, unknowns, 0.01, 0.3)
