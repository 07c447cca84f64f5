"""Parts of the building of the morphable model that need no scans; ``build_identity --check`` checks the whole."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from faceposer.geometry.alignment import Similarity
from faceposer.geometry.mesh import TriangleMesh
from faceposer.geometry.nearest_surface import NearestSurface
from faceposer.identity.model import IdentityModel
from faceposer.identity.model_file import load_identity_model
from faceposer.identity.registration import Registration
from faceposer.identity.template import head_template
from faceposer.resources import asset_path
from scripts.build_identity import LICENCE_NAME, differences, others
from scripts.identity_building.correspondence import _even
from scripts.identity_building.curves import _halves, _matched
from scripts.identity_building.filling import Filler, eroded, links_of
from scripts.identity_building.learning import balanced_weights
from scripts.identity_building.marked_points import EAR, NOSE
from scripts.identity_building.scans import ScannedPeople, openings, rings


def grid(side: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return a flat grid of ``side``² vertices and its quads, counter-clockwise."""
    rows = np.arange(float(side))
    vertices = np.stack(np.meshgrid(rows, rows, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    first = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    return vertices, np.stack([first, first + side, first + side + 1, first + 1], axis=1).astype(np.int32)


def test_filling_is_harmonic() -> None:
    vertices, quads = grid(9)
    links = links_of(quads, len(vertices))
    inside = np.abs(vertices[:, :2] - 4.0).max(axis=1) < 3.0
    # x, y and x² - y² are harmonic on a grid; x² + y² is not, and its filling is lower than at the rim.
    x, y = vertices[:, 0] - 4.0, vertices[:, 1] - 4.0
    wanted = np.stack([x, y, x**2 - y**2, x**2 + y**2], axis=1)
    filled = Filler(~inside, links)(np.where(inside[:, None], np.nan, wanted))
    assert np.allclose(filled[:, :3], wanted[:, :3])
    assert np.array_equal(filled[~inside], wanted[~inside])
    assert filled[inside, 3].max() <= wanted[~inside, 3].max()
    assert filled[40, 3] > wanted[40, 3] + 5.0


def test_the_rim_is_given_up_but_for_curves() -> None:
    vertices, quads = grid(9)
    links = links_of(quads, len(vertices))
    known = np.ones(len(vertices), dtype=bool)
    known[40] = False
    kept = np.zeros(len(vertices), dtype=bool)
    kept[41] = True
    steps = np.abs(vertices[:, :2] - 4.0).sum(axis=1)
    # Curves are fences: the vertex right behind the one that is kept remains, too.
    expected = (steps > 2.0) | kept
    expected[42] = True
    assert np.array_equal(eroded(known, links, kept, 2), expected)


def test_rings_and_borders_of_a_grid() -> None:
    vertices, quads = grid(7)
    (border,) = openings(quads)
    assert len(border) == 24
    assert np.abs(np.diff(vertices[np.append(border, border[0])], axis=0)).sum(axis=1).max() == 1.0
    found = rings(quads, border, 3)
    assert [len(ring) for ring in found] == [24, 16, 8, 1]


def test_curves_correspond_by_shares_of_their_length() -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    circle = np.stack([np.cos(angles), 0.5 * np.sin(angles), 0.0 * angles], axis=1)
    upper, lower = _halves(circle, np.arange(40), 1.0)
    assert circle[upper, 1].min() > -1e-12
    assert circle[lower, 1].max() < 1e-12
    for chain in (upper, lower):
        assert np.allclose(circle[chain[[0, -1]], 0], [-1.0, 1.0])
        assert (np.diff(circle[chain, 0]) > 0.0).all()
    # Another sampling of the same line, moved: points land on it, in order, and the ends on its ends.
    fine = np.linspace(np.pi, 0.0, 500)
    line = np.stack([np.cos(fine), 0.5 * np.sin(fine), 0.0 * fine], axis=1) + [5.0, 0.0, 0.0]
    matched = _matched(upper, circle, line)
    assert np.abs(matched.places - circle[upper] - [5.0, 0.0, 0.0]).max() < 0.01


def test_marked_points_are_on_the_left_of_the_man() -> None:
    template = head_template()
    for rows, depth in ((EAR, 2.0), (NOSE, 8.0)):
        vertices = template.rest[[vertex for vertex, _ in rows]]
        places = np.array([place for _, place in rows])
        assert (vertices[:, 0] > 0.0).all()
        assert (places[:, 0] > 0.0).all()
        assert ((places[:, 2] > depth) == (depth > 5.0)).all()
        # The man and the scans' mean are alike once moved onto each other.
        moved = vertices - vertices.mean(axis=0) - places + places.mean(axis=0)
        assert np.linalg.norm(moved, axis=1).max() < 1.3


def test_scans_are_read(tmp_path: Path) -> None:
    faces = np.array([[0, 1, 2, 3], [11250, 11251, 11252, 11253], [11254, 11255, 11256, -1]], dtype=np.int32)
    np.savez(
        tmp_path / "people.npz",
        mean=np.zeros((11260, 3), np.float32),
        modes=np.zeros((2, 11260, 3), np.float16),
        faces=faces,
        material=np.array([0, 1, 2]),
        material_names=np.array(["M_Face", "M_BackHead", "M_IrisLeft"]),
        landmarks68=np.arange(68),
    )
    people = ScannedPeople.read(tmp_path / "people.npz")
    # Sockets and the inside of the mouth are shown, but are no skin.
    assert people.quads.tolist() == [[0, 1, 2, 3]]
    assert people.shown.tolist() == faces.tolist()
    assert people.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert people.colours[11255, 0] < people.colours[0, 0]


def test_a_check_finds_what_differs() -> None:
    stored = load_identity_model()
    assert differences(stored, stored) == []
    changed = IdentityModel(10, stored.template, stored.segments)
    for name in ("mean", "noise", "total_variance", "n_heads"):
        setattr(changed, name, getattr(stored, name))
    changed.standard_deviations, changed.modes = stored.standard_deviations[:10], stored.modes[:10]
    assert differences(changed, stored) == ["number of modes"]
    changed.standard_deviations, changed.modes = 1.2 * stored.standard_deviations, stored.modes
    changed.mean = stored.mean + 0.1
    assert differences(changed, stored) == ["mean", "modes"]


def test_other_parts_of_the_file_are_kept() -> None:
    meta, members = others(asset_path("identity.npz"))
    assert meta["format"] == "faceposer.identity"
    assert not any(name.startswith("shape.") for name in members)
    assert others(Path("no such file")) == ({}, {})
    assert "MIT License" in (asset_path("licences") / LICENCE_NAME).read_text()


@pytest.mark.parametrize("seed", [1, 2])
def test_balanced_weights_have_exact_moments(seed: int) -> None:
    weights = balanced_weights(seed, 50, 8)
    assert weights.shape == (100, 8)
    assert np.allclose(weights.mean(axis=0), 0.0)
    assert np.allclose(weights.T @ weights / 100, np.eye(8))


def test_correspondence_becomes_the_same_on_both_sides() -> None:
    template = head_template()
    mesh = TriangleMesh(template.rest, template.triangles)
    # Vertices that have slid along the surface, to the same side everywhere.
    slid = template.rest + 0.05 * np.roll(template.rest, 1, axis=1) / np.abs(template.rest).max()
    points, distances = NearestSurface(template.rest, template.triangles, np.arange(len(template.triangles))).points(
        slid
    )
    places = points.positions(template.rest, template.triangles)
    frame = Similarity(np.eye(3), np.zeros(3), np.array(2.0))
    used = np.ones(len(places), dtype=bool)
    found = _even(Registration(frame.apply(places), frame, points, distances, used), template.mirror, mesh)
    flip = np.array([-1.0, 1.0, 1.0])

    def asymmetry(vertices: NDArray[np.float64]) -> float:
        return float(np.linalg.norm(vertices - vertices[template.mirror] * flip, axis=1).mean())

    assert asymmetry(places) > 0.005
    assert asymmetry(found.vertices / 2.0) < 1e-9
    there = found.points.positions(template.rest, template.triangles)
    assert asymmetry(there) < 0.1 * asymmetry(places)
    np.testing.assert_allclose(np.linalg.norm(found.in_target() - there, axis=1), found.distances / 2.0, atol=1e-9)
