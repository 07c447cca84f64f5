"""Teeth, the inside of the mouth, shells of eyes and clear films are found in files that keep them otherwise."""

import os
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from faceposer.geometry.polygon_mesh import Group, PolygonMesh
from faceposer.interchange.glb import write_glb
from faceposer.model.character import Part
from faceposer.model.contact.arches import find_arches
from faceposer.model.contact.eyeballs import find_eyeballs
from faceposer.model.contact.measure import penetration_mm
from faceposer.model.face_model import build_face_model
from faceposer.training.eyes import add_gaze, misplaced_eyes
from faceposer.training.mouth_parts import find_mouth
from faceposer.training.parts import material_of, split_into_parts
from faceposer.training.request import TrainingRequest, train

RIGS = os.environ.get("FACEPOSER_RIGS")
Array = NDArray[np.float64]


def ball(centre: tuple[float, float, float], size: tuple[float, float, float], n: int = 8) -> tuple[Array, Array]:
    """Return vertices and triangles of an ellipsoid, each corner only once."""
    rings = [[(0.0, 1.0, 0.0)]]
    for i in range(1, n):
        up = np.pi * i / n
        turn = 2.0 * np.pi * np.arange(2 * n) / (2 * n)
        rings.append([(float(np.sin(up) * np.sin(t)), float(np.cos(up)), float(np.sin(up) * np.cos(t))) for t in turn])
    rings.append([(0.0, -1.0, 0.0)])
    starts = np.concatenate([[0], np.cumsum([len(ring) for ring in rings])])
    triangles = []
    for i in range(n):
        upper, lower = np.arange(*starts[i : i + 2]), np.arange(*starts[i + 1 : i + 3])
        for k in range(2 * n):
            a, b = upper[k % len(upper)], upper[(k + 1) % len(upper)]
            c, d = lower[k % len(lower)], lower[(k + 1) % len(lower)]
            triangles += [corners for corners in ((a, c, d), (a, d, b)) if len(set(corners)) == 3]
    points = np.array([point for ring in rings for point in ring])
    return points * size + centre, np.array(triangles)


def joined(*pieces: tuple[Array, Array]) -> tuple[Array, Array]:
    starts = np.cumsum([0] + [len(points) for points, _ in pieces])
    triangles = [each + start for (_, each), start in zip(pieces, starts, strict=False)]
    return np.concatenate([points for points, _ in pieces]), np.concatenate(triangles)


HEAD = ball((0.0, 0.0, 0.0), (7.0, 10.0, 9.0), 16)


def crowns(z: float = 6.0, y: float = -4.0, spacing: float = 0.6) -> list[tuple[Array, Array]]:
    return [ball((x * spacing, y, z - 0.1 * x * x), (0.35, 0.5, 0.3), 5) for x in (-4, -3, -2, -1, 0, 1, 2, 3, 4)]


def test_rows_of_crowns_and_the_mouth_around_them_are_found() -> None:
    mouth = ball((0.0, -4.0, 5.0), (4.2, 1.5, 2.5))
    vertices, triangles = joined(HEAD, mouth, *crowns())
    found = find_mouth(triangles, vertices)
    assert found is not None
    assert len(found.teeth) == 9
    assert len(found.mouth) == 1
    on_mouth = np.isin(found.islands, found.mouth)
    assert on_mouth.sum() == len(mouth[1])
    assert np.isin(found.islands, found.teeth).sum() == sum(len(each) for _, each in crowns())


@pytest.mark.parametrize(
    "islands",
    [
        crowns(z=12.0),  # a chain of beads before the mouth
        crowns(spacing=1.4),  # too wide a row
        [ball((x, y, 4.0), (0.35, 0.5, 0.3), 5) for x in (-1, 0, 1) for y in (-6, -3, 0, 3)],  # spread over the head
        [ball((0.5 + 0.4 * x, -4.0, 6.0), (0.35, 0.5, 0.3), 5) for x in range(9)],  # on one side
        crowns() + [ball((2.0 * x, 6.0, 8.5), (0.3, 0.3, 0.3), 5) for x in (-2, -1, 0, 1, 2)],  # studs among them
    ],
)
def test_other_islands_of_a_skin_are_no_teeth(islands: list[tuple[Array, Array]]) -> None:
    vertices, triangles = joined(HEAD, *islands)
    assert find_mouth(triangles, vertices) is None


def test_a_mesh_of_one_piece_has_no_mouth() -> None:
    assert find_mouth(HEAD[1], HEAD[0]) is None


def test_parts_of_the_mouth_have_names_and_materials() -> None:
    vertices, triangles = joined(HEAD, ball((0.0, -4.0, 5.0), (4.2, 1.5, 2.5)), *crowns())
    mesh = PolygonMesh(vertices, triangles.astype(np.int32), groups=(Group("face", (0, len(triangles)), "all"),))
    parted = split_into_parts(mesh, vertices, np.zeros((len(vertices), 1)))
    assert [(part.name, part.material) for part in parted.parts] == [
        ("face", "skin"),
        ("face_teeth", "teeth"),
        ("face_mouth", "gums"),
    ]
    assert parted.materials == ("all", "all", "all")
    back = vertices[parted.file_ids]
    np.testing.assert_array_equal(back[parted.polygons[:, :3]].shape, triangles[:, :, None].repeat(3, 2).shape)
    for part, low in zip(parted.parts, (-10.0, -4.6, -5.6), strict=True):
        assert back[slice(*part.vertices), 1].min() == pytest.approx(low, abs=0.1)


def test_clear_shells_over_the_eyes_are_films() -> None:
    for name in ("M_EyeOcclusion", "M_LacrimalFluid", "eyeTearLine", "M_EyeBlend", "eyeshell_lod0", "Eye_Wetness"):
        assert material_of(name) == "film", name
    assert material_of("M_EyeLashes") == "lashes"
    assert material_of("M_ScleraLeft") == "eye"
    assert material_of("caruncle_left") == "skin"


def test_concentric_shells_turn_about_one_centre_and_eyes_in_one_place_are_named() -> None:
    pieces = [ball((3.0, 1.0, 5.0), (1.5, 1.5, 1.5)), ball((3.05, 1.0, 5.1), (1.3, 1.3, 1.3))]
    vertices, _ = joined(*pieces)
    n = len(pieces[0][0])
    parts = [Part("sclera", "eye", (0, 1), (0, n)), Part("iris", "eye", (1, 2), (n, 2 * n))]
    shapes = np.zeros((1, 2 * n, 3), dtype=np.float32)
    assert add_gaze(vertices, parts, ["eyeLookUpLeft"], shapes) == ["sclera", "iris"]
    moved = vertices + shapes[0]
    # All keep their distances from the sclera's centre.
    before, after = (np.linalg.norm(points - [3.0, 1.0, 5.0], axis=1) for points in (vertices, moved))
    np.testing.assert_allclose(after, before, atol=1e-4)
    assert misplaced_eyes(vertices, parts) == []
    both = [Part("eyeLeft", "eye", (0, 1), (0, n)), Part("eyeRight", "eye", (1, 2), (n, 2 * n))]
    assert "eyeLeft and eyeRight are in the same place" in misplaced_eyes(vertices - [3.0, 0.0, 0.0], both)[0]
    assert misplaced_eyes(vertices, both) == []


@pytest.mark.skipif(not RIGS, reason="FACEPOSER_RIGS names no folder of rigs")
@pytest.mark.parametrize(("name", "arches"), [("facecap", 1), ("facecap_multi", 2)])
def test_contact_keeps_lips_before_teeth_that_are_in_the_skin(name: str, arches: int, tmp_path: Path) -> None:
    character = train(TrainingRequest("rig", Path(RIGS or "") / f"{name}.glb", name, name))
    model = build_face_model(character)
    assert len(find_arches(character)) == arches, "the soft inside of the mouth is none"
    np.testing.assert_array_equal(model.surface(model.neutral()), character.vertices)
    deepest = {False: 0.0, True: 0.0}
    for weights in (
        {"jawOpen": 0.6, "mouthRollLower": 1.5},
        {"mouthRollUpper": 2.0, "mouthRollLower": 2.0, "jawOpen": 0.2},
        {"mouthPressLeft": 1.5, "mouthPressRight": 1.5, "mouthShrugLower": -1.0},
    ):
        pose = model.coefficients_of(weights)
        for contact, before in deepest.items():
            depth = penetration_mm(model, model.surface(pose, contact))["lips_teeth"]
            deepest[contact] = max(before, depth)
    assert deepest[False] > 0.3
    assert deepest[True] <= 0.1
    assert len(find_eyeballs(character)) == (2 if name == "facecap_multi" else 0)
    write_glb(tmp_path / "a.glb", model, model.neutral())
