import io
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from faceposer.geometry.alignment import rigid_alignment
from faceposer.geometry.camera import OrbitView, ViewName
from faceposer.geometry.picking import pick
from faceposer.model.character import ARKIT_SHAPES, Character, Part
from faceposer.model.character_file import load_character
from faceposer.model.contact.step import ContactStep
from faceposer.model.shape_names import SPLIT_SHAPES, whole_shape_of
from faceposer.resources import asset_path

PEOPLE = ("man", "woman")
NAMES = (*PEOPLE, "low")
REGIONS = {
    *(f"{region}_{side}" for region in ("brow", "lids", "eye", "cheek", "ear") for side in ("left", "right")),
    *("nose", "mouth", "lip_upper", "lip_lower", "jaw", "neck", "scalp", "forehead"),
}
#: Feature points that are each other's mirror image: left, right.
PAIRS = [
    *(("8.3", "8.4"), ("2.4", "2.5"), ("4.1", "4.2"), ("4.3", "4.4"), ("4.5", "4.6")),
    *(("3.5", "3.6"), ("3.7", "3.12"), ("3.11", "3.8"), ("3.1", "3.2"), ("3.3", "3.4")),
    *(("5.1", "5.2"), ("9.1", "9.2"), ("10.1", "10.2"), ("2.13", "2.14")),
]


@pytest.fixture(scope="module", params=NAMES)
def character(request: pytest.FixtureRequest) -> Character:
    return load_character(request.param)


@pytest.fixture(scope="module", params=PEOPLE)
def person(request: pytest.FixtureRequest) -> Character:
    return load_character(request.param)


def posed(character: Character, **weights: float) -> NDArray[np.float32]:
    result = character.vertices.copy()
    for name, weight in weights.items():
        result += np.float32(weight) * character.shapes[character.shape_names.index(name)]
    return result


def border_loops(character: Character, part: Part) -> list[list[int]]:
    """Return the loops of open edges of a part, checking that it is a manifold with consistent orientation."""
    quads = character.polygons[slice(*part.polygons)]
    sides = [(a, b) for polygon in quads.tolist() for a, b in zip(polygon, polygon[1:] + polygon[:1], strict=True)]
    # A triangle (a, b, c, -1) has the sides (a, b), (b, c) and (c, a).
    first = [polygon[0] for polygon in quads.tolist() for _ in polygon]
    directed = [(a, b if b >= 0 else start) for (a, b), start in zip(sides, first, strict=True) if a >= 0]
    count = Counter(map(tuple, directed))
    assert max(count.values()) == 1, f"{part.name}: neighbours face opposite ways, or an edge has three faces"
    onward = {a: b for a, b in count if (b, a) not in count}
    loops = []
    while onward:
        start, here = onward.popitem()
        loop = [start]
        while here != start:
            loop.append(here)
            here = onward.pop(here)
        loops.append(loop)
    return loops


def test_the_mesh_is_of_the_promised_size(person: Character) -> None:
    assert 17_000 <= len(person.vertices) <= 27_000
    assert (person.polygons >= 0).all()
    used = np.unique(person.polygons)
    assert len(used) == len(person.vertices)
    corners = person.vertices[person.triangles]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert (area > 0).mean() > 0.999


def test_parts_are_named(person: Character) -> None:
    assert {part.name: part.material for part in person.parts} == {
        "skin": "skin",
        "eye_left": "eye",
        "eye_right": "eye",
        "teeth_upper": "teeth",
        "gums_upper": "gums",
        "teeth_lower": "teeth",
        "gums_lower": "gums",
        "throat": "gums",
        "tongue": "tongue",
        "lashes_left": "lashes",
        "lashes_right": "lashes",
    }


def test_the_skin_is_open_at_the_neck_alone_and_level_there(person: Character) -> None:
    (loop,) = border_loops(person, person.part("skin"))
    edge = person.vertices[loop]
    assert len(loop) == 84
    assert edge[:, 1].max() < person.vertices[person.feature_points["2.1"], 1] - 3
    assert np.ptp(edge[:, 1]) < 2.0
    # All of it lies in one plane.
    offsets = edge - edge.mean(axis=0)
    assert np.linalg.svd(offsets, compute_uv=False)[2] / np.sqrt(len(edge)) < 0.02


def test_the_other_parts_are_manifolds_too(person: Character) -> None:
    n_loops = {part.name: len(border_loops(person, part)) for part in person.parts}
    assert n_loops["eye_left"] == n_loops["eye_right"] == n_loops["tongue"] == 0
    assert n_loops["teeth_upper"] == n_loops["teeth_lower"] == 14, "each crown is open in the gum"
    assert n_loops["gums_upper"] == n_loops["gums_lower"] == 1, "the gum of a jaw goes on as palate or floor"
    assert n_loops["throat"] == 2, "the soft palate and the wall behind it"
    assert n_loops["lashes_left"] == n_loops["lashes_right"] == 2


def test_the_neutral_face_is_symmetric(character: Character) -> None:
    distance, partner = cKDTree(character.vertices).query(character.vertices * np.float32([-1, 1, 1]))
    assert np.percentile(distance, 99) < 1e-3
    assert distance.max() < 2e-3
    for left in (name for name in character.regions if name.endswith("_left")):
        right = left.replace("_left", "_right")
        assert set(partner[character.regions[left]].tolist()) == set(character.regions[right].tolist())


def test_sizes_are_those_of_a_head(character: Character) -> None:
    assert 20 < character.height < 25
    assert abs(character.vertices[:, 0].mean()) < 0.05
    width = np.ptp(character.vertices[character.regions["scalp"], 0])
    assert 13 < width < 18


def test_shapes_are_those_of_arkit_in_order_two_of_them_in_halves(character: Character) -> None:
    assert tuple(dict.fromkeys(map(whole_shape_of, character.shape_names))) == ARKIT_SHAPES
    assert set(character.shape_names) - set(ARKIT_SHAPES) == set(SPLIT_SHAPES)
    assert len(character.shape_names) == 54
    assert len(set(ARKIT_SHAPES)) == 52
    assert np.linalg.norm(character.shapes, axis=2).max(axis=1).min() > 0.1, "none is empty"


def test_shapes_move_the_side_they_name(character: Character) -> None:
    x = character.vertices[:, 0]
    amount = np.linalg.norm(character.shapes, axis=2)
    for name, moved in zip(character.shape_names, amount, strict=True):
        if name in ("jawLeft", "jawRight", "mouthLeft", "mouthRight"):
            chin = character.shapes[character.shape_names.index(name), character.feature_points["8.2"], 0]
            assert chin * (1 if name.endswith("Left") else -1) > 0.2, name
        elif name.endswith("Left"):
            assert moved @ x > 0.1 * moved @ np.abs(x), name
        elif name.endswith("Right"):
            assert moved @ x < -0.1 * moved @ np.abs(x), name


def test_regions_are_named_and_where_they_should_be(character: Character) -> None:
    assert set(character.regions) == REGIONS
    assert min(map(len, character.regions.values())) > (10 if character.name == "low" else 50)
    middle = {name: character.vertices[ids].mean(axis=0) for name, ids in character.regions.items()}
    order = ["neck", "jaw", "lip_lower", "lip_upper", "nose", "eye_left", "brow_left", "forehead"]
    heights = [middle[name][1] for name in order]
    assert heights == sorted(heights)
    for name, place in middle.items():
        if name.endswith("_left"):
            assert place[0] > 2, name
        elif name.endswith("_right"):
            assert place[0] < -2, name
    assert not set(character.regions["jaw"].tolist()) & set(character.regions["nose"].tolist())


def test_feature_points_are_those_of_mpeg4(character: Character) -> None:
    points = character.feature_points
    assert 46 <= len(points) <= 68
    assert points.keys() == character.feature_titles.keys()
    assert len(set(points.values())) == len(points)
    assert len(set(character.feature_titles.values())) == len(points)
    p = {name: character.vertices[vertex] for name, vertex in points.items()}
    for left, right in PAIRS:
        np.testing.assert_allclose(p[left], p[right] * [-1, 1, 1], atol=2e-3)
        assert p[left][0] > 0.3, left
        assert "left" in character.feature_titles[left]
        assert "right" in character.feature_titles[right]
    for name in ("2.1", "2.2", "2.3", "2.10", "8.1", "8.2", "9.3", "9.15", "11.1", "11.4", "11.6"):
        assert abs(p[name][0]) < 1e-3, name
    column = ["2.1", "2.10", "8.2", "2.3", "2.2", "8.1", "9.15", "9.3", "9.12", "11.1", "11.4"]
    assert [p[name][1] for name in column] == sorted(p[name][1] for name in column)
    skin = character.vertices[slice(*character.part("skin").vertices)]
    assert p["9.3"][2] == pytest.approx(skin[:, 2].max(), abs=0.05)
    assert p["11.4"][1] == pytest.approx(skin[:, 1].max(), abs=0.3)
    assert p["3.11"][0] < p["3.5"][0] < p["3.7"][0], "inner corner, pupil, outer corner"
    assert p["3.3"][1] < p["3.5"][1] < p["3.1"][1], "lower lid, pupil, upper lid"
    assert p["4.1"][0] < p["4.3"][0] < p["4.5"][0]


@pytest.mark.parametrize(("side", "pupil"), [("Left", "3.5"), ("Right", "3.6")])
def test_the_pupil_turns_with_the_gaze(character: Character, side: str, pupil: str) -> None:
    part = character.part(f"eye_{side.lower()}")
    ball = slice(*part.vertices)
    vertex = character.feature_points[pupil]
    outwards = 1 if side == "Left" else -1
    centre = 0.5 * (character.vertices[ball].min(axis=0) + character.vertices[ball].max(axis=0))
    expected = {"LookOut": (outwards, 0), "LookIn": (-outwards, 0), "LookUp": (0, 1), "LookDown": (0, -1)}
    for action, (right, up) in expected.items():
        vertices = posed(character, **{f"eye{action}{side}": 1.0})
        move = vertices[vertex] - character.vertices[vertex]
        assert move[:2] @ [right, up] > 0.5, action
        # It is a turn: the ball stays where it was and keeps its shape.
        rest = np.linalg.norm(character.vertices[ball] - centre, axis=1)
        np.testing.assert_allclose(np.linalg.norm(vertices[ball] - centre, axis=1), rest, atol=0.03)
    other = character.part("eye_right" if side == "Left" else "eye_left")
    still = character.shapes[character.shape_names.index(f"eyeLookUp{side}"), slice(*other.vertices)]
    assert not still.any()


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_blink_shuts_the_lids_in_front_of_the_eye(character: Character, side: str) -> None:
    upper, lower = (character.feature_points[name] for name in (("3.1", "3.3") if side == "left" else ("3.2", "3.4")))
    shape = f"eyeBlink{side.capitalize()}"

    def gap(weight: float) -> float:
        vertices = posed(character, **{shape: weight})
        return float(vertices[upper, 1] - vertices[lower, 1])

    assert gap(0.0) > 0.6
    assert gap(0.5) == pytest.approx(0.5 * gap(0.0), abs=0.15)
    assert abs(gap(1.0)) < 0.1
    ball = character.vertices[slice(*character.part(f"eye_{side}").vertices)]
    centre = 0.5 * (ball.min(axis=0) + ball.max(axis=0))
    radius = 0.5 * np.ptp(ball[:, 1])
    lids = character.regions[f"lids_{side}"]
    ahead = lids[character.vertices[lids, 2] > centre[2] + 0.5 * radius]
    outside = ahead[np.linalg.norm(character.vertices[ahead] - centre, axis=1) > radius]
    assert len(outside) > (25 if character.name == "low" else 100)
    for weight in (0.25, 0.5, 0.75, 1.0):
        distance = np.linalg.norm(posed(character, **{shape: weight})[outside] - centre, axis=1)
        assert distance.min() > radius - 0.02, weight


def test_lashes_stay_on_the_lids(person: Character) -> None:
    skin = slice(*person.part("skin").vertices)
    lashes = np.arange(*person.part("lashes_left").vertices)
    polygons = slice(*person.part("lashes_left").polygons)
    v = np.zeros(len(person.vertices))
    v[person.polygons[polygons]] = person.uv[person.polygon_uvs[polygons], 1]
    roots = lashes[np.isclose(v[lashes], 0.52) | np.isclose(v[lashes], 0.02)]
    assert len(roots) >= 40
    for name in ("eyeBlinkLeft", "eyeSquintLeft", "eyeWideLeft", "eyeLookDownLeft", "cheekSquintLeft"):
        vertices = posed(person, **{name: 1.0})
        assert cKDTree(vertices[skin]).query(vertices[roots])[0].max() < 0.1, name


def part_shapes(character: Character, name: str) -> NDArray[np.float32]:
    """Return the offsets of the part ``name``, shape (S, n, 3)."""
    return character.shapes[:, slice(*character.part(name).vertices)]


def test_nothing_moves_the_upper_teeth(character: Character) -> None:
    for name in {"teeth_upper", "gums_upper", "throat"} & {part.name for part in character.parts}:
        assert not part_shapes(character, name).any(), name


def test_the_jaw_takes_the_lower_teeth_with_it_rigidly(character: Character) -> None:
    """Teeth and gums of the lower jaw move by the jaw's shapes alone, and no distance between them changes."""
    jaw = ("jawOpen", "jawForward", "jawLeft", "jawRight")
    start = character.vertices[slice(*character.part("teeth_lower").vertices)].astype(float)
    names = [part.name for part in character.parts if part.name.endswith("_lower")]
    for shape, moved in zip(character.shape_names, part_shapes(character, "teeth_lower"), strict=True):
        assert moved.any() == (shape in jaw), shape
        motion = rigid_alignment(start, start + moved)
        for name in names:
            part = slice(*character.part(name).vertices)
            offsets = character.shapes[character.shape_names.index(shape), part]
            expected = motion.apply(character.vertices[part]) - character.vertices[part]
            np.testing.assert_allclose(offsets, expected, atol=2e-3)


def test_the_jaw_turns_about_a_line_before_the_ears(character: Character) -> None:
    start = character.vertices[slice(*character.part("teeth_lower").vertices)].astype(float)
    opened = part_shapes(character, "teeth_lower")[character.shape_names.index("jawOpen")]
    motion = rigid_alignment(start, start + opened)
    turn = Rotation.from_matrix(motion.rotation).as_rotvec(degrees=True)
    np.testing.assert_allclose(turn, [22.0, 0.0, 0.0], atol=0.3)
    # Where y and z stay.
    y, z = np.linalg.solve((np.eye(3) - motion.rotation)[1:, 1:], motion.translation[1:])
    ear = character.vertices[character.regions["ear_left"]]
    assert ear[:, 1].min() < y < ear[:, 1].max()
    assert ear[:, 2].max() - 1.0 < z < ear[:, 2].max() + 1.5
    incisors = start[:, 2].argmax()
    assert 8.5 < np.hypot(np.hypot(start[incisors, 1] - y, start[incisors, 2] - z), 5.0) < 11.0, "Bonwill's triangle"
    tongue = part_shapes(character, "tongue")[character.shape_names.index("jawOpen")]
    assert tongue[:, 1].mean() < -0.8


def test_upper_incisors_overlap_the_lower_ones(character: Character) -> None:
    upper, lower = (character.vertices[slice(*character.part(f"teeth_{jaw}").vertices)] for jaw in ("upper", "lower"))
    above, below = upper[np.abs(upper[:, 0]) < 0.8], lower[np.abs(lower[:, 0]) < 0.4]
    assert 0.2 < below[:, 1].max() - above[:, 1].min() < 0.3, "overbite"
    assert 0.2 < above[:, 2].max() - below[:, 2].max() < 0.5, "overjet"


def test_the_tongue_lies_behind_the_lower_teeth(character: Character) -> None:
    tongue, lower = (character.vertices[slice(*character.part(name).vertices)] for name in ("tongue", "teeth_lower"))
    incisors = lower[np.abs(lower[:, 0]) < 0.5]
    assert tongue[:, 2].max() < incisors[:, 2].max() - 0.2
    assert tongue[:, 1].max() < incisors[:, 1].max() + 0.7
    length, height = np.ptp(tongue[:, 2]), np.ptp(tongue[np.abs(tongue[:, 2] - tongue[:, 2].max()) < 2.0, 1])
    assert length > 4.0
    assert height < 0.45 * length
    out = tongue + part_shapes(character, "tongue")[character.shape_names.index("tongueOut")]
    lips = character.vertices[character.feature_points["2.3"]]
    assert 1.0 < out[:, 2].max() - lips[2] < 3.0


def test_the_tongue_lies_on_the_lower_lip_when_it_is_out(character: Character) -> None:
    around = 8 if character.name == "low" else 20
    for opening in (0.0, 0.3):
        vertices = posed(character, tongueOut=1.0, jawOpen=opening).astype(float)
        rings = vertices[slice(*character.part("tongue").vertices)][:-2].reshape(-1, around, 3)
        lip = vertices[character.feature_points["2.3"]]
        top, bottom = (
            np.interp(lip[2], np.maximum.accumulate(line[:, 2]), line[:, 1])
            for line in (rings[:, around // 4], rings[:, 3 * around // 4])
        )
        assert -0.3 < bottom - lip[1] < 0.03, "it touches the lip"
        assert 0.6 < top - bottom < 1.1, "it is thick"
        assert rings[-1, :, 1].mean() < lip[1], "it bends down"
        assert rings[-3:, :, 1].min() > lip[1] - 1.2
        if opening == 0.0:
            upper = vertices[character.feature_points["2.2"]]
            assert 0.4 < upper[1] - lip[1] < 0.9


def test_the_lips_are_shut_in_the_neutral_face(character: Character) -> None:
    """From the front, whatever is seen along the mouth is skin: no teeth and no tongue."""
    camera = OrbitView.preset(character.vertices.min(axis=0), character.vertices.max(axis=0), "front").camera(
        (800, 800)
    )
    corner = character.vertices[character.feature_points["8.3"]]
    top, bottom = (character.vertices[character.feature_points[name], 1] for name in ("2.2", "2.3"))
    first, stop = character.part_triangles(character.part("skin"))
    # No ray in the plane of symmetry: it would run along edges.
    for x in np.linspace(-0.95, 0.95, 10) * corner[0]:
        for y in np.linspace(min(bottom, corner[1]) - 0.1, top + 0.1, 9):
            (pixel,) = camera.project(np.array([[x, y, corner[2] + 1.0]]))
            hit = pick(character.vertices, character.triangles, camera, (pixel[0], pixel[1]))
            assert hit is not None
            assert first <= hit.face < stop, (x, y)


def test_textures_are_images_of_every_material_but_none_else(person: Character) -> None:
    assert set(person.textures) == {"skin", "eye", "teeth", "gums", "throat", "tongue", "lashes"}
    images = {name: Image.open(io.BytesIO(data)) for name, data in person.textures.items()}
    assert images["skin"].size == (2048, 2048)
    assert images["lashes"].mode == "RGBA"
    assert all(image.mode == "RGB" for name, image in images.items() if name != "lashes")
    assert person.uv.min() >= 0
    assert person.uv.max() <= 1


def colour_at(character: Character, vertex: int) -> NDArray[np.float64]:
    part = next(part for part in character.parts if part.vertices[0] <= vertex < part.vertices[1])
    image = np.asarray(Image.open(io.BytesIO(character.textures[part.material])).convert("RGB"), dtype=float)
    polygon, corner = np.argwhere(character.polygons == vertex)[0]
    u, v = character.uv[character.polygon_uvs[polygon, corner]]
    row, column = int((1 - v) * image.shape[0]), int(u * image.shape[1])
    return image[max(row - 6, 0) : row + 7, max(column - 6, 0) : column + 7].mean(axis=(0, 1))


def test_the_paint_lies_where_the_face_has_it(character: Character) -> None:
    points = character.feature_points
    cheek, lip, brow = (colour_at(character, points[name]) for name in ("5.1", "8.2", "4.3"))
    crown, pupil, forehead = (colour_at(character, points[name]) for name in ("11.4", "3.5", "9.12"))
    # Dark skin is itself of a redder colour.
    factor = 1.03 if character.name == "low" else 1.08
    assert lip[0] / lip[1] > factor * cheek[0] / cheek[1], "lips are redder than cheeks"
    assert brow.sum() < 0.75 * forehead.sum(), "brows are darker than skin"
    assert crown.sum() < 0.65 * forehead.sum(), "hair is darker than skin"
    assert pupil.max() < 30


def test_no_chart_of_the_skin_overlaps_itself(character: Character) -> None:
    stop = character.part_triangles(character.part("skin"))[1]
    corners = character.uv[character.triangle_uvs[:stop]].astype(float)
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    # In the source's layout the end of the throat is folded, of which few triangles leave a larger share.
    least = 0.998 if character.name == "low" else 0.999
    assert (one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0] > -1e-9).mean() > least
    area = 0.5 * np.abs(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]).sum()
    assert 0.8 < area < 1.0


def test_all_assets_together_stay_small() -> None:
    folder = asset_path("")
    total = sum(path.stat().st_size for path in Path(folder).rglob("*") if path.is_file())
    assert total < 24_000_000
    assert asset_path("identity.npz").stat().st_size < 8_000_000


def test_the_low_head_has_few_triangles_and_a_topology_of_its_own() -> None:
    low = load_character("low")
    assert 600 <= len(low.vertices) <= 1800
    skin = low.part("skin")
    triangles = low.polygons[slice(*skin.polygons)]
    assert (triangles[:, 3] == -1).all()
    (loop,) = border_loops(low, skin)
    assert low.vertices[loop, 1].max() < low.vertices[low.feature_points["2.1"], 1] - 3
    corners = low.vertices[low.triangles]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert area.min() > 1e-4
    # Most of its vertices lie where the face moves.
    still = sum(len(low.regions[name]) for name in ("scalp", "neck", "ear_left", "ear_right"))
    assert still < 0.35 * (skin.vertices[1] - skin.vertices[0])


def test_eyeballs_of_the_low_head_stay_behind_its_lids() -> None:
    """From the front, whatever is seen of the eyes is within the lids' edges, and nothing of them when they shut."""
    low = load_character("low")
    camera = OrbitView.preset(low.vertices.min(axis=0), low.vertices.max(axis=0), "front").camera((800, 800))
    eyes = [low.part_triangles(low.part(f"eye_{side}")) for side in ("left", "right")]
    shut = posed(low, eyeBlinkLeft=1.0, eyeBlinkRight=1.0)
    for names in (("3.1", "3.3", "3.7", "3.11"), ("3.2", "3.4", "3.12", "3.8")):
        upper, lower, outer, inner = (low.vertices[low.feature_points[name]] for name in names)
        for x in np.linspace(inner[0], outer[0], 15):
            for y in np.linspace(lower[1] - 0.5, upper[1] + 0.5, 15):
                (pixel,) = camera.project(np.array([[x, y, upper[2]]]))
                for vertices in (low.vertices, shut):
                    hit = pick(vertices, low.triangles, camera, (pixel[0], pixel[1]))
                    assert hit is not None
                    on_eye = any(first <= hit.face < stop for first, stop in eyes)
                    within = vertices is low.vertices and lower[1] - 0.12 < y < upper[1] + 0.12
                    assert within or not on_eye, (x, y)


@pytest.mark.parametrize("view", ["front", "three-quarter", "left"])
def test_nothing_of_an_eye_is_seen_between_the_shut_lids_of_the_low_head(view: ViewName) -> None:
    low = load_character("low")
    shut = posed(low, eyeBlinkLeft=1.0, eyeBlinkRight=1.0)
    touching = shut.copy()
    ContactStep.of(low).apply(touching)
    camera = OrbitView.preset(low.vertices.min(axis=0), low.vertices.max(axis=0), view).camera((800, 800))
    first, stop = low.part_triangles(low.part("eye_left"))
    ball = shut[slice(*low.part("eye_left").vertices)]
    pixels = camera.project(ball)
    (left, top), (right, bottom) = pixels.min(axis=0), pixels.max(axis=0)
    for x in np.linspace(left, right, 24):
        for y in np.linspace(top, bottom, 40):
            for vertices in (shut, touching):
                hit = pick(vertices, low.triangles, camera, (x, y))
                assert hit is None or not first <= hit.face < stop, (x, y)


def test_the_two_are_different_people() -> None:
    man, woman = map(load_character, PEOPLE)
    np.testing.assert_array_equal(man.polygons, woman.polygons)
    skin = slice(*man.part("skin").vertices)
    assert np.linalg.norm(man.vertices[skin] - woman.vertices[skin], axis=1).mean() > 0.3
    assert np.abs(colour_at(man, man.feature_points["3.9"]) - colour_at(woman, woman.feature_points["3.9"])).max() > 5
