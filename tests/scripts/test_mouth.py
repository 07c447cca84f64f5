"""The inside of the mouth, as it is made before it is put into a head."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import cKDTree

from faceposer.identity.anatomy.jaw import OPENING, jaw_opening, jaw_rotation
from faceposer.model.character import ARKIT_SHAPES
from scripts.asset_building.dental_arch import CANINE, LOWER, MOLAR, N_KINDS, UPPER, Arch, MouthFrame
from scripts.asset_building.gums import build_gum, build_throat
from scripts.asset_building.mouth import JawMotion, build_mouth, jaw_hinge
from scripts.asset_building.piece import Floats, Ints, Piece
from scripts.asset_building.simple_mouth import build_simple_mouth
from scripts.asset_building.starter_poses import STARTERS
from scripts.asset_building.teeth import build_crowns

FRAME = MouthFrame(np.zeros(3), 1.0)
HINGE = np.array([5.0, 4.0, -8.5])
ARCHES = pytest.mark.parametrize("arch", [UPPER, LOWER], ids=["upper", "lower"])


@pytest.fixture(scope="module")
def jaw() -> JawMotion:
    shapes = np.zeros((len(ARKIT_SHAPES), 4, 3))
    shapes[ARKIT_SHAPES.index("jawForward"), :, 2] = 0.8
    shapes[ARKIT_SHAPES.index("jawLeft"), :, 0] = 0.7
    shapes[ARKIT_SHAPES.index("jawRight"), :, 0] = -0.7
    return JawMotion(HINGE, shapes, ARKIT_SHAPES)


@pytest.fixture(scope="module")
def pieces(jaw: JawMotion) -> dict[str, Piece]:
    return {piece.name: piece for piece in build_mouth(FRAME, jaw)}


def crowns(arch: Arch) -> Floats:
    """Return the vertices of each crown, left and right alternately from the middle backwards, shape (14, n, 3)."""
    vertices = build_crowns(arch, FRAME)[0]
    return vertices.reshape(2 * N_KINDS, -1, 3)


def winding_numbers(points: Floats, corners: Floats) -> Floats:
    """Return how often the triangles (T, 3, 3) go around each of ``points`` (n, 3): Jacobson et al. 2013, eq. (6)."""
    result = np.empty(len(points))
    for k, point in enumerate(points):
        a, b, c = np.swapaxes(corners - point, 0, 1)
        la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
        top = np.einsum("ti,ti->t", a, np.cross(b, c))
        dots = [np.einsum("ti,ti->t", one, other) for one, other in ((a, b), (b, c), (c, a))]
        result[k] = np.arctan2(top, la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb).sum() / (2.0 * np.pi)
    return result


def triangles(vertices: Floats, quads: Ints) -> Floats:
    corners: Floats = vertices[np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])]
    return corners


@ARCHES
def test_the_crowns_have_the_measures_they_were_given(arch: Arch) -> None:
    for kind, crown in enumerate(crowns(arch)[::2]):
        line, normal = arch.at(np.array(0.5 * (arch.edges[kind] + arch.edges[kind + 1])))
        tangent = FRAME.place(*[np.array(x) for x in (-normal[1], normal[0], 0.0)])
        assert np.ptp(crown @ tangent) == pytest.approx(arch.width[kind], rel=0.04)
        outward = FRAME.place(*[np.array(x) for x in (normal[0], normal[1], 0.0)])
        # What inclination adds is not thickness.
        lean = abs(np.tan(np.deg2rad(arch.inclination[kind]))) * arch.length[kind]
        assert arch.depth[kind] - 0.12 < np.ptp(crown @ outward) < arch.depth[kind] + lean + 0.12
        assert line[1] >= arch.setback


def test_the_arches_are_as_wide_as_published_means() -> None:
    """Tips of the canines and of the first molars' mesiobuccal cusps, in centimetres."""
    tips = {}
    for arch in (UPPER, LOWER):
        left = crowns(arch)[::2]
        canine = left[CANINE][np.argmin(arch.up * left[CANINE][:, 1])]
        molar = left[MOLAR]
        crest = molar[arch.up * molar[:, 1] < np.min(arch.up * molar[:, 1]) + 0.07]
        tips[arch.up] = (2.0 * canine[0], 2.0 * crest[:, 0].max())
    # Woelfel, Igarashi and Dong (2014): 34.8 mm; the others are within two standard deviations of Class I means.
    assert tips[1][0] == pytest.approx(3.48, abs=0.12)
    assert tips[-1][0] == pytest.approx(2.69, abs=0.32)
    assert tips[1][1] == pytest.approx(5.38, abs=0.56)
    assert tips[-1][1] == pytest.approx(5.17, abs=0.52)
    assert tips[-1][1] < tips[1][1]


@ARCHES
def test_each_crown_touches_its_neighbours(arch: Arch) -> None:
    all_crowns = crowns(arch)
    rows = [*all_crowns[1::2][::-1], *all_crowns[::2]]
    for one, other in pairwise(rows):
        # Vertices lie up to half an edge beside the place of contact.
        assert cKDTree(one).query(other)[0].min() < 0.12


def test_the_closed_arches_do_not_enter_each_other(pieces: dict[str, Piece]) -> None:
    upper, lower = pieces["teeth_upper"], pieces["teeth_lower"]
    middle = crowns(UPPER)[0].mean(axis=0)
    assert winding_numbers(middle[None], triangles(upper.vertices, upper.quads)) > 0.8, "faces point outwards"
    assert winding_numbers(lower.vertices, triangles(upper.vertices, upper.quads)).max() < 0.5
    assert winding_numbers(upper.vertices, triangles(lower.vertices, lower.quads)).max() < 0.5


@ARCHES
def test_the_gum_covers_the_ends_of_the_crowns(arch: Arch) -> None:
    """Each crown's open end lies inside the gum: going up, down, out or in from it one meets the gum or the crown."""
    gum, _, _ = build_gum(arch, FRAME)
    tree = cKDTree(gum)
    for crown in crowns(arch):
        end = crown[:14]
        deepest = arch.up * end[:, 1].mean()
        near = gum[tree.query_ball_point(end.mean(axis=0), 0.9)]
        outside = near[arch.up * near[:, 1] > deepest - 0.05]
        assert len(outside) > 6
        # There is gum on both sides of it.
        away = (outside - end.mean(axis=0))[:, [0, 2]] @ end.mean(axis=0)[[0, 2]]
        assert away.min() < 0.0 < away.max()


@ARCHES
def test_the_gum_is_one_sheet_without_folds(arch: Arch) -> None:
    vertices, quads, uv = build_gum(arch, FRAME)
    corners = vertices[quads]
    area = np.linalg.norm(np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]), axis=1)
    assert (area > 1e-5).mean() > 0.99
    assert uv.min() >= 0.0
    assert uv.max() <= 1.0
    # Palate and floor face the mouth.
    middle = np.abs(corners.mean(axis=1)[:, 0]) < 0.5
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    behind = middle & (corners.mean(axis=1)[:, 2] < -2.0)
    assert (arch.up * normal[behind, 1] < 0.0).all()


def test_the_throat_is_closed_behind_the_tongue(pieces: dict[str, Piece]) -> None:
    """From between the incisors, the gaze backwards ends on a surface wherever it goes within the arch."""
    vertices, quads, _ = build_throat(FRAME)
    walls = [(vertices, quads)] + [(pieces[name].vertices, pieces[name].quads) for name in ("gums_upper", "tongue")]
    faces = np.concatenate([triangles(*wall) for wall in walls])
    start = np.array([0.0, -0.1, -0.6])
    for x in np.linspace(-1.8, 1.8, 7):
        for y in np.linspace(-1.0, 1.6, 7):
            direction = np.array([x, y, -5.5]) / np.linalg.norm([x, y, -5.5])
            assert _meets(faces, start, direction), (x, y)


def test_every_surface_faces_the_mouth(pieces: dict[str, Piece]) -> None:
    tongue = pieces["tongue"]
    middle = tongue.vertices.mean(axis=0)
    assert winding_numbers(middle[None], triangles(tongue.vertices, tongue.quads)) == pytest.approx(1.0)
    throat = triangles(pieces["throat"].vertices, pieces["throat"].quads)
    middles = throat.mean(axis=1)
    normals = np.cross(throat[:, 1] - throat[:, 0], throat[:, 2] - throat[:, 0])
    to_incisors = np.array([0.0, 0.0, -0.5]) - middles
    in_sight = np.abs(middles[:, 0]) < 1.5
    assert (np.einsum("ti,ti->t", normals, to_incisors)[in_sight] > 0.0).all()


def _meets(faces: Floats, start: Floats, direction: Floats) -> bool:
    """Return whether a ray meets one of the triangles (Möller and Trumbore 1997)."""
    one, other = faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]
    across = np.cross(direction, other)
    scale = np.einsum("ti,ti->t", one, across)
    scale = np.where(np.abs(scale) < 1e-12, np.nan, scale)
    away = start - faces[:, 0]
    u = np.einsum("ti,ti->t", away, across) / scale
    turned = np.cross(away, one)
    v = turned @ direction / scale
    distance = np.einsum("ti,ti->t", other, turned) / scale
    return bool(((u >= -1e-6) & (v >= -1e-6) & (u + v <= 1 + 1e-6) & (distance > 0)).any())


def test_the_jaw_turns_about_its_hinge() -> None:
    points = np.array([[0.0, 0.0, 0.0], [3.0, -1.0, -4.0], [5.0, 4.0, -8.5]])
    opened = points + jaw_opening(points, HINGE)
    distance = np.linalg.norm((points - HINGE)[:, 1:], axis=1)
    np.testing.assert_allclose(np.linalg.norm((opened - HINGE)[:, 1:], axis=1), distance)
    np.testing.assert_allclose(opened[:, 0], points[:, 0])
    np.testing.assert_allclose(opened[2], HINGE)
    assert opened[0, 1] < -2.0, "it opens downwards"
    assert opened[0, 2] < 0.0, "and backwards"
    half = jaw_rotation(points, 0.5 * OPENING, HINGE)
    np.testing.assert_allclose(jaw_rotation(half, 0.5 * OPENING, HINGE), opened)
    each = jaw_rotation(points, np.array([0.0, OPENING, 90.0]), HINGE)
    np.testing.assert_allclose(each[:2], [points[0], opened[1]])


def test_the_hinge_follows_the_head() -> None:
    vertices = np.random.default_rng(1).normal(size=(19158, 3))
    moved = jaw_hinge(vertices + [0.0, 2.0, -1.0])
    np.testing.assert_allclose(moved - jaw_hinge(vertices), [0.0, 2.0, -1.0])


def test_what_moves_in_the_mouth(pieces: dict[str, Piece]) -> None:
    moving = {
        name: {shape for shape, offsets in zip(ARKIT_SHAPES, piece.shapes, strict=True) if offsets.any()}
        for name, piece in pieces.items()
    }
    jaw_shapes = {"jawOpen", "jawForward", "jawLeft", "jawRight"}
    assert moving == {
        "teeth_upper": set(),
        "gums_upper": set(),
        "throat": set(),
        "teeth_lower": jaw_shapes,
        "gums_lower": jaw_shapes,
        "tongue": {*jaw_shapes, "tongueOut"},
    }


@pytest.mark.parametrize("opening", [0.0, 0.5, 1.0])
def test_the_tongue_stays_between_the_teeth(pieces: dict[str, Piece], opening: float) -> None:
    shape = ARKIT_SHAPES.index("jawOpen")
    tongue = pieces["tongue"].vertices + opening * pieces["tongue"].shapes[shape]
    for name in ("teeth_upper", "teeth_lower"):
        teeth = pieces[name].vertices + opening * pieces[name].shapes[shape]
        assert winding_numbers(tongue, triangles(teeth, pieces[name].quads)).max() < 0.5


def viseme(piece: Piece, name: str) -> Floats:
    """Return the vertices of ``piece`` in the pose ``name`` of those that come with the program, shape (n, 3)."""
    (starter,) = (one for one in STARTERS if one.name == name)
    moved: Floats = np.tensordot([starter.sided().get(shape, 0.0) for shape in ARKIT_SHAPES], piece.shapes, axes=1)
    return piece.vertices + moved


def test_the_tongue_stays_behind_the_teeth_for_l(pieces: dict[str, Piece]) -> None:
    tongue, quads = viseme(pieces["tongue"], "L"), pieces["tongue"].quads
    upper, lower = (viseme(pieces[name], "L") for name in ("teeth_upper", "teeth_lower"))
    for name, teeth in (("teeth_upper", upper), ("teeth_lower", lower)):
        assert winding_numbers(tongue, triangles(teeth, pieces[name].quads)).max() < 0.5
        assert winding_numbers(teeth, triangles(tongue, quads)).max() < 0.5
    # What is seen of it lies in the gap between the incisors.
    edge_above = upper[np.abs(upper[:, 0]) < 0.4][:, 1].min()
    edge_below = lower[np.abs(lower[:, 0]) < 0.4][:, 1].max()
    assert edge_below < tongue[-1, 1] < edge_above + 0.2


def test_the_tip_of_the_tongue_comes_between_the_teeth(pieces: dict[str, Piece]) -> None:
    """As for TH: with the jaw a little open the tongue fills the gap between the incisors."""
    tongue, upper, lower = (viseme(pieces[name], "TH") for name in ("tongue", "teeth_upper", "teeth_lower"))
    assert tongue[:, 2].max() > upper[:, 2].max() + 0.1
    there = tongue[(np.abs(tongue[:, 2] - upper[:, 2].max()) < 0.35) & (np.abs(tongue[:, 0]) < 0.4)]
    edge_above = upper[np.abs(upper[:, 0]) < 0.4][:, 1].min()
    edge_below = lower[np.abs(lower[:, 0]) < 0.4][:, 1].max()
    assert edge_below < there[:, 1].max() < edge_above + 0.1
    assert edge_above - there[:, 1].max() < 0.2


def test_the_simple_mouth_has_few_vertices_and_the_same_place(jaw: JawMotion, pieces: dict[str, Piece]) -> None:
    simple = {piece.name: piece for piece in build_simple_mouth(FRAME, jaw)}
    assert simple.keys() == {"teeth_upper", "teeth_lower", "throat", "tongue"}
    assert sum(len(piece.vertices) for piece in simple.values()) < 520
    for name in ("teeth_upper", "teeth_lower"):
        front, fine = (mouth[name].vertices[:, 2].max() for mouth in (simple, pieces))
        assert front == pytest.approx(fine, abs=0.2)
