from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from faceposer.geometry.subdivision import catmull_clark, linear_split
from faceposer.identity.anatomy.eyeballs import CORNEA_HEIGHT, IRIS_ANGLE, surface_radius
from faceposer.identity.anatomy.lids import keep_clear
from faceposer.model.character import ARKIT_SHAPES, Character
from faceposer.model.character_file import load_character
from scripts.asset_building.creature_expressions import EXPRESSIONS
from scripts.asset_building.creature_units import goblin_units
from scripts.asset_building.decimation import Decimation
from scripts.asset_building.ears import turn_ears
from scripts.asset_building.eyes import build_eye, turned_eye
from scripts.asset_building.piece import grid_quads
from scripts.asset_building.raster import TexelMap, draw_strokes, map_texels, smoothstep, softened, softening
from scripts.asset_building.refinement import refined_in_places
from scripts.asset_building.swell import Swell, swollen
from scripts.asset_building.symmetry import even, even_units
from scripts.asset_building.transfer import fitted_units
from scripts.asset_building.unwrap import Layout, _rounded_quarter, unwrap_skin
from scripts.build_assets import differences

CUBE = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
CUBE_QUADS = np.array(
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]], dtype=np.int32
)


def test_a_cube_is_subdivided_as_catmull_and_clark_say() -> None:
    fine = catmull_clark(CUBE_QUADS, 8)
    points = fine.matrix @ CUBE
    assert points.shape == (26, 3)
    assert fine.quads.shape == (24, 4)
    np.testing.assert_allclose(np.abs(points[:8]), 5 / 9)
    np.testing.assert_allclose(np.sort(np.abs(points[8 : fine.n_edge_points])), np.tile([0, 0.75, 0.75], (12, 1)))
    np.testing.assert_allclose(np.sort(np.abs(points[fine.n_edge_points :])), np.tile([0, 0, 1], (6, 1)))
    np.testing.assert_allclose(fine.matrix.sum(axis=1), 1.0)
    np.testing.assert_array_equal(fine.quads[:, 0], CUBE_QUADS.ravel(), "the quads follow the old corners")


def test_an_open_border_follows_its_own_curve() -> None:
    x, y = np.meshgrid(np.arange(4.0), np.arange(3.0))
    grid = np.stack([x.ravel(), y.ravel(), (x**2).ravel()], axis=1)
    quads = np.array([[r * 4 + c, r * 4 + c + 1, r * 4 + c + 5, r * 4 + c + 4] for r in range(2) for c in range(3)])
    points = catmull_clark(quads.astype(np.int32), 12).matrix @ grid
    np.testing.assert_allclose(points[0], grid[0], err_msg="corners stay")
    np.testing.assert_allclose(points[1], (grid[0] + 6 * grid[1] + grid[2]) / 8)
    split = linear_split(quads.astype(np.int32), 12)
    np.testing.assert_allclose((split.matrix @ grid)[:12], grid)


def test_halves_are_evened_out() -> None:
    mirror = np.array([1, 0, 2], dtype=np.int32)
    vertices = np.array([[1.0, 2.0, 0.0], [-3.0, 2.0, 0.0], [0.5, 1.0, 1.0]])
    np.testing.assert_allclose(even(vertices, mirror), [[2, 2, 0], [-2, 2, 0], [0, 1, 1]])
    left = np.array([[0.0, 1.0, 0.0], [0, 0, 0], [0, 0, 0]])
    units = even_units({"aLeft": left, "aRight": np.zeros((3, 3))}, mirror)
    np.testing.assert_allclose(units[0][0], [0, 0.5, 0])
    np.testing.assert_allclose(units[1][1], [0, 0.5, 0])


def test_texels_get_what_lies_under_them() -> None:
    uv = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    corners = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    positions = np.concatenate([2.0 * uv, np.zeros((4, 1))], axis=1)[corners]
    texels = map_texels(uv, corners, positions, uv[corners], 8)
    assert texels.covered.all()
    image = texels.image(texels.values)
    np.testing.assert_allclose(image[0, 0], [0.5 / 8, 7.5 / 8], atol=1e-6)
    np.testing.assert_allclose(image[7, 7], [7.5 / 8, 0.5 / 8], atol=1e-6)
    np.testing.assert_allclose(texels.along[0], [[4, 0, 0], [0, -4, 0]], atol=1e-5)
    np.testing.assert_allclose(texels.pixels_per_area, 16, rtol=1e-5)


def test_smoothstep_runs_either_way() -> None:
    x = np.array([0.0, 1.0, 2.0], dtype=np.float32)
    np.testing.assert_allclose(smoothstep(0.0, 2.0, x), [0, 0.5, 1])
    np.testing.assert_allclose(smoothstep(2.0, 0.0, x), [1, 0.5, 0])


@pytest.fixture(scope="module")
def man() -> Character:
    return load_character("man")


@pytest.mark.slow
def test_the_check_sees_every_kind_of_difference(man: Character) -> None:
    assert differences(man, man) == []
    moved = man.vertices.copy()
    moved[100, 1] += 0.01
    assert differences(replace(man, vertices=moved), man) == ["vertices"]
    assert differences(replace(man, credits="mine"), man) == ["credits"]
    assert differences(replace(man, regions={**man.regions, "nose": man.regions["nose"][1:]}), man) == ["regions: nose"]
    other = {**man.textures, "tongue": man.textures["gums"]}
    assert differences(replace(man, textures=other), man) == ["textures: tongue"]


def test_the_outside_is_laid_out_without_folds() -> None:
    """A sphere that is open below, with a small chart of its own in front, as the mouth's inside has."""
    rows, columns = 13, 24
    theta = np.linspace(0.35, 2.5, rows)[:, None]
    phi = np.arange(columns)[None, :] * (2 * np.pi / columns)
    ring = np.stack(np.broadcast_arrays(np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)), -1)
    points = 10.0 * ring.reshape(-1, 3)
    points[np.abs(points[:, 0]) < 1e-9, 0] = 0.0
    quads = grid_quads(rows, columns, closed=True)[:, [0, 3, 2, 1]]
    # The crown is closed by a fan of quads around a vertex on top.
    top = len(points)
    points = np.concatenate([points, [[0.0, 10.5, 0.0]]])
    cap = [[top, c, c + 1, (c + 2) % columns] for c in range(0, columns, 2)]
    quads = np.concatenate([quads, cap]).astype(np.int32)
    layout = unwrap_skin(points, quads, Layout(points[:, :2], quads), np.ones(len(points)))
    corners = layout.uv[layout.quad_uvs]
    assert corners.min() >= 0
    assert corners.max() <= 1
    one, other = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    assert (one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0] > 0).all()


def grid(rows: int, columns: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return a flat square of squares in the plane z = 0, from (0, 0) to (columns - 1, rows - 1)."""
    x, y = np.meshgrid(np.arange(float(columns)), np.arange(float(rows)))
    return np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1), grid_quads(rows, columns)


def test_a_mesh_is_refined_in_places_without_gaps() -> None:
    points, quads = grid(6, 6)
    fine = catmull_clark(quads, len(points))
    chosen = np.zeros(25, dtype=bool)
    chosen[[12, 13]] = True
    mesh = refined_in_places(fine, chosen)
    assert len(mesh.kept) == 36 + 7 + 2, "old corners, and the edges and centres of two squares side by side"
    triangles = mesh.polygons[:, 3] < 0
    assert triangles.sum() == 3 * 6
    count = Counter(
        (int(a), int(b))
        for polygon in mesh.polygons
        for a, b in zip(polygon[polygon >= 0], np.roll(polygon[polygon >= 0], -1), strict=True)
    )
    assert max(count.values()) == 1
    open_edges = [edge for edge in count if edge[::-1] not in count]
    assert len(open_edges) == 20, "it is open along its old border alone"
    vertices = (fine.split @ points)[mesh.kept]
    area = sum(flat_area(vertices[polygon[polygon >= 0]]) for polygon in mesh.polygons)
    assert area == pytest.approx(25.0)
    np.testing.assert_array_equal(mesh.kept[mesh.index(fine.split.shape[0])[mesh.kept]], mesh.kept)


def test_squares_between_refined_ones_are_refined_too() -> None:
    points, quads = grid(4, 4)
    chosen = np.zeros(9, dtype=bool)
    chosen[[3, 5]] = True
    mesh = refined_in_places(catmull_clark(quads, len(points)), chosen)
    assert (mesh.polygons[:, 3] >= 0).sum() == 3 * 4
    assert (mesh.polygons[:, 3] < 0).sum() == 6 * 3


def flat_area(corners: NDArray[np.float64]) -> float:
    x, y = corners[:, 0], corners[:, 1]
    return float(0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def simplified(bump: float, n_vertices: int) -> tuple[Decimation, NDArray[np.float64]]:
    """Simplify a flat grid that has a bump in its second pose."""
    points, quads = grid(13, 13)
    moved = points.copy()
    moved[:, 2] += bump * np.exp(-((points[:, :2] - [3.0, 3.0]) ** 2).sum(axis=1) / 2.0)
    triangles = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    ring = [*range(13), *range(25, 169, 13), *range(167, 155, -1), *range(143, 0, -13)]
    border = np.array([*zip(ring, [*ring[1:], ring[0]], strict=True)], dtype=np.int32)
    work = Decimation(
        np.stack([points, moved]),
        triangles,
        np.ones(len(points)),
        border,
        np.array([0, 12, 156, 168], dtype=np.int32),
        np.zeros(len(triangles), dtype=np.int32),
        points[None, :, :2],
    )
    work.run(n_vertices)
    return work, points


def test_simplifying_keeps_outline_and_corners() -> None:
    work, points = simplified(0.0, 30)
    triangles = np.array(list(work.triangles.values()))
    assert len(np.unique(triangles)) == 30
    assert {0, 12, 156, 168} <= set(triangles.ravel().tolist())
    areas = [flat_area(points[triangle]) for triangle in triangles]
    assert min(areas) > 0
    assert sum(areas) == pytest.approx(144.0)


def test_simplifying_keeps_vertices_where_a_pose_moves_them() -> None:
    work, points = simplified(1.0, 40)
    used = np.unique(list(work.triangles.values()))
    near = np.linalg.norm(points[used, :2] - [3.0, 3.0], axis=1) < 3.0
    share = (np.linalg.norm(points[:, :2] - [3.0, 3.0], axis=1) < 3.0).mean()
    assert near.mean() > 2 * share


def test_units_follow_the_stretch_and_turn_of_a_head() -> None:
    rng = np.random.default_rng(3)
    rest = rng.uniform(-4.0, 4.0, (600, 3))
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    head = 1.5 * rest @ turn.T
    units = rng.standard_normal((2, 600, 3))
    chosen = np.arange(600) < 500
    fitted = fitted_units(rest, head, units, chosen)
    error = np.abs(fitted[:, :500] - 1.5 * units[:, :500] @ turn.T).mean()
    # The ridge that keeps flat places determined holds back a little.
    assert error < 0.25 * np.abs(units).mean() < 0.25 * np.abs(fitted - units)[:, :500].mean()
    np.testing.assert_array_equal(fitted[:, 500:], units[:, 500:])


def test_swelling_is_symmetric_and_fades_out() -> None:
    points = np.array([[3.0, 1.0, 0.0], [-3.0, 1.0, 0.0], [4.0, 1.0, 0.0], [-4.0, 1.0, 0.0], [2.0, 1.0, 0.0]])
    points = np.concatenate([points, [[-2.0, 1.0, 0.0], [30.0, 0.0, 0.0]]])
    moved = swollen(points, points, (Swell((3.0, 1.0, 0.0), (2.0, 2.0, 2.0), (1.5, 1.0, 1.0)),))
    np.testing.assert_allclose(moved[[1, 3, 5]], moved[[0, 2, 4]] * [-1, 1, 1], atol=1e-12)
    np.testing.assert_allclose(moved[0], [3.0, 1.0, 0.0], atol=1e-9)
    assert moved[2, 0] - moved[4, 0] > 2.5
    np.testing.assert_allclose(moved[6], points[6])


def test_ears_turn_about_their_roots_as_mirror_images() -> None:
    place = np.array(
        [[s * x, 70.0 + y, 5.0] for s in (1.0, -1.0) for x in (7.0, 7.3, 8.0, 8.5) for y in (0.0, 1.0, 2.0)]
    )
    free = np.clip(np.abs(place[:, 0]) - 7.0, 0.0, 1.0)
    left = turn_ears(place, place, free, "Left", np.array([0.0, 0.0, 20.0]))
    right = turn_ears(place, place, free, "Right", np.array([0.0, 0.0, 20.0]))
    np.testing.assert_allclose(left[12:], 0.0, atol=1e-12)
    np.testing.assert_allclose(right[12:], left[:12] * [-1, 1, 1], atol=1e-12)
    np.testing.assert_allclose(left[:3], 0.0, atol=1e-12, err_msg="the roots stay")
    assert left[9:12, 1].min() > 0.1, "the free rim rises"


def test_an_eye_turned_by_two_shapes_stays_round() -> None:
    eye = build_eye("Left", np.array([3.0, 1.0, 2.0]), 1.4, ARKIT_SHAPES)
    moved = eye.vertices + turned_eye(eye.vertices, "Left", {"LookOut": 0.8, "LookUp": 0.7})
    centre = eye.vertices[-1] + [0.0, 0.0, 1.4]
    for vertices in (eye.vertices, moved):
        assert np.linalg.norm(vertices - centre, axis=1).min() == pytest.approx(1.4)
    assert (moved[0] - eye.vertices[0])[:2].min() > 0.2, "outwards and up"


def test_the_creature_has_fifty_examples_that_name_units() -> None:
    assert len(EXPRESSIONS) == 50
    ears = {f"ear{way}{side}" for way in ("Up", "Down", "Back", "Forward") for side in ("", "Left", "Right")}
    both = {name.removesuffix("Left") for name in ARKIT_SHAPES if name.endswith("Left")}
    for name, strengths in EXPRESSIONS.items():
        assert strengths.keys() <= {*ARKIT_SHAPES, *both, *ears}, name
        assert all(0.0 < strength <= 1.5 for strength in strengths.values()), name
    for name in (name for name in EXPRESSIONS if name.endswith("_left")):
        swapped = {
            unit.replace("Left", "*").replace("Right", "Left").replace("*", "Right"): strength
            for unit, strength in EXPRESSIONS[name].items()
        }
        assert EXPRESSIONS[name.replace("_left", "_right")] == swapped, name
    assert len({tuple(sorted(strengths.items())) for strengths in EXPRESSIONS.values()}) == 50


def two_charts() -> tuple[TexelMap, NDArray[np.float32]]:
    """Return a strip 4 cm long at 10 texels per centimetre, cut in the middle and laid out apart, and its places."""
    covered = np.zeros((30, 80), dtype=bool)
    covered[5:25, 5:25] = covered[5:25, 45:65] = True
    row, column = np.nonzero(covered)
    along = np.where(column < 40, column - 5, column - 45 + 20) / 10.0
    places = np.stack([along, row / 10.0, 0 * along], axis=1).astype(np.float32)
    slopes = np.tile(np.array([[10.0, 0.0, 0.0], [0.0, 10.0, 0.0]], np.float32), (len(places), 1, 1))
    return TexelMap(covered, places, slopes), places


def test_hairs_go_on_over_a_seam_of_the_texture() -> None:
    texels, places = two_charts()
    flow = np.tile(np.array([1.0, 0.0, 0.0], np.float32), (len(places), 1))
    starts = np.flatnonzero((np.abs(places[:, 0] - 1.0) < 0.01) & (np.abs(places[:, 1] - 1.5) < 0.01))
    one = np.ones(len(starts), np.float32)
    allowed = np.ones(len(places), dtype=bool)
    ended, whole = (
        draw_strokes(texels, flow, starts, 2.0 * one, one, 0 * one, allowed, known) for known in (None, places)
    )
    assert ended[:, 20:24].sum() > 0
    assert ended[:, 45:].sum() == 0
    assert whole[14:17, 46:52].sum(axis=0).min() > 0.3 * ended[14:17, 16:20].sum(axis=0).mean()
    assert whole[:, 58:].sum() == 0, "no longer than a hair is"


def test_the_layouts_border_has_round_upper_corners_and_is_convex() -> None:
    path = _rounded_quarter()
    assert path[0].tolist() == [0.5, 1.0]
    assert path[-1].tolist() == [0.0, 0.0]
    steps = np.diff(path, axis=0)
    turn = steps[:-1, 0] * steps[1:, 1] - steps[:-1, 1] * steps[1:, 0]
    assert turn.min() > -1e-9
    angles = np.degrees(np.arcsin(turn / np.linalg.norm(steps[:-1], axis=1) / np.linalg.norm(steps[1:], axis=1)))
    assert angles.max() < 5


def test_detail_is_softened_where_texels_grow_and_nowhere_else() -> None:
    texels, _ = two_charts()
    assert softening(texels, 8.0).max() < 0.3
    mixed = TexelMap(np.ones((40, 80), dtype=bool), texels.values, np.zeros((3200, 2, 3), np.float32))
    mixed.along[:, 0, 0] = mixed.along[:, 1, 1] = 40.0 * np.where(np.arange(3200) % 80 > 40, 0.25, 1.0)
    sigma = softening(mixed, 16.0)
    assert sigma[20, 38] > 1.0
    assert sigma[20, 5] < 0.3
    assert sigma[20, 60] < 0.3
    noise = np.random.default_rng(1).standard_normal((40, 80)).astype(np.float32)
    blurred = softened(noise, sigma)
    assert np.abs(blurred[:, :4] - noise[:, :4]).max() < 0.5
    assert blurred[:, 35:40].std() < 0.5 * noise[:, 35:40].std()


def test_the_goblins_brows_tilt_and_its_lids_go_further() -> None:
    rng = np.random.default_rng(0)
    rest = np.column_stack([rng.uniform(-6.5, 6.5, 400), rng.uniform(62.0, 78.0, 400), np.full(400, 15.0)])
    people = np.zeros((len(ARKIT_SHAPES), len(rest), 3))
    row = {name: k for k, name in enumerate(ARKIT_SHAPES)}
    people[row["browInnerUp"], :, 1] = 1.0
    people[[row["browDownLeft"], row["browDownRight"]], :, 1] = -1.0
    people[row["eyeWideLeft"], :, 1] = 1.0
    goblin = goblin_units(people, rest)
    brow = rest[:, 1] > 74.6
    inner, outer = brow & (np.abs(rest[:, 0]) < 2.0), brow & (np.abs(rest[:, 0]) > 6.0)
    assert goblin[row["browInnerUp"], inner, 1].min() > 1.5
    assert goblin[row["browInnerUp"], outer, 1].max() < 0.0
    assert goblin[row["browDownLeft"], inner, 1].max() < -1.5
    assert goblin[row["browDownLeft"], outer, 1].min() > 0.0
    assert np.all(goblin[row["eyeWideLeft"], :, 1] > 1.5)
    # Neither lids nor what no unit moves is changed by what brows do; a sneer lifts its own side.
    assert np.all(goblin[row["browInnerUp"], rest[:, 1] < 73.4, 1] == 1.0)
    assert not np.any(goblin[row["jawOpen"]])
    sneer = goblin[row["noseSneerLeft"], :, 1]
    assert sneer[rest[:, 0] > 1.0].max() > 0.2
    assert sneer[rest[:, 0] < -1.5].max() < 0.02


def test_lids_keep_off_the_cornea_as_well() -> None:
    centre, radius = np.array([3.0, 1.0, 2.0]), 1.5
    angles = np.linspace(-0.4, 0.4, 41)
    across = np.stack([0 * angles, np.sin(angles), np.cos(angles)], axis=1)
    lid = centre + 1.6 * radius * across
    # A lid that is pressed onto the ball ends before its surface, the bulge of the cornea included.
    pressed = (centre + 0.9 * radius * across - lid)[None]
    mended = keep_clear(lid, pressed, np.zeros(0, dtype=np.int32), centre, radius, (1.0,), 2.0)
    distance = np.linalg.norm(lid + mended[0] - centre, axis=1)
    assert np.all(distance >= radius * surface_radius(np.degrees(np.abs(angles))) + 0.069)
    assert surface_radius(np.zeros(1))[0] == 1.0 + CORNEA_HEIGHT
    assert np.all(surface_radius(np.array([IRIS_ANGLE, 60.0])) == 1.0)
