"""What a scan has beyond the model."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from faceposer.geometry.mesh import TriangleMesh
from faceposer.identity.scans import detail as detail_module
from faceposer.identity.scans.basis import HeadBasis, region_mask
from faceposer.identity.scans.detail import SETTINGS, Detail, faded, find_detail
from faceposer.model.character_file import load_character


@pytest.fixture(scope="module")
def bump(basis: HeadBasis) -> np.ndarray:
    """Return a bump of 2 mm on the right cheek as offsets."""
    middle = basis.mean[np.argmin(np.linalg.norm(basis.mean - [-4.5, -1.5, 8.0], axis=1))]
    height = 0.2 * np.exp(-0.5 * (np.linalg.norm(basis.mean - middle, axis=1) / 0.8) ** 2)
    return height[:, None] * basis.normals(basis.mean)


@pytest.fixture(scope="module")
def detail(basis: HeadBasis, bump: np.ndarray) -> Detail:
    """Return the detail of a scan of the mean with the bump, which ends behind the face."""
    vertices = basis.mean + bump
    kept = basis.triangles[(vertices[basis.triangles, 2] > 0.0).all(axis=1)]
    return find_detail(basis, basis.mean, np.zeros_like(bump), TriangleMesh(vertices, kept))


def test_a_bump_is_found(basis: HeadBasis, bump: np.ndarray, detail: Detail) -> None:
    on_it = np.linalg.norm(bump, axis=1) > 0.02
    assert detail.known[on_it].mean() > 0.7
    assert 10.0 * np.linalg.norm(detail.offsets - bump, axis=1)[on_it].mean() < 0.2


def test_nothing_is_known_where_there_is_no_scan(basis: HeadBasis, detail: Detail) -> None:
    behind = basis.mean[:, 2] < -0.5
    assert not detail.known[behind].any()
    assert 10.0 * np.abs(detail.offsets[behind]).max() < 0.1


def test_offsets_fade_smoothly(basis: HeadBasis) -> None:
    known = basis.mean[:, 2] > 8.0
    offsets = faded(basis, np.where(known[:, None], [0.0, 0.0, 0.1], 0.0), known)
    assert 0.09 < np.median(offsets[known, 2]) < 0.11
    assert np.abs(offsets[basis.mean[:, 2] < -5.0]).max() < 0.01
    steps = np.linalg.norm(offsets[basis.triangles[:, 0]] - offsets[basis.triangles[:, 1]], axis=1)
    assert steps.max() < 0.04


def test_hair_is_not_taken_for_skin(basis: HeadBasis, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(detail_module, "SETTINGS", replace(SETTINGS, stiffness=(100.0, 3.0), rounds=1))
    scalp = region_mask(load_character("man"), ["scalp"], len(basis.mean))
    apart, _ = cKDTree(basis.mean[scalp]).query(basis.mean)
    hair = 2.0 * np.clip(1.0 - apart, 0.0, 1.0)
    vertices = basis.mean + hair[:, None] * basis.normals(basis.mean)
    found = find_detail(basis, basis.mean, np.zeros_like(vertices), TriangleMesh(vertices, basis.triangles))
    # Hair rises from the skin within a centimetre; the head does not follow it.
    assert hair[basis.trust >= 0.2].max() > 1.0
    assert 10.0 * np.linalg.norm(found.offsets, axis=1).max() < 0.5
    assert not found.known[hair > 0.1].any()
