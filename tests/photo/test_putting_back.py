"""Heads put back into photos that were drawn from them, so that the changed photo is known."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.photo.glasses_in_photo import glasses_in
from faceposer.photo.head_in_photo import HeadInPhoto
from faceposer.photo.photo import Photo
from faceposer.photo.putting_back import photo_change, put_back
from faceposer.photo.surface_in_picture import SurfaceInPicture, inside_of_mouth
from faceposer.session.putting_back import head_in_photo

SIZE = (240, 260)
CAMERA = Camera(np.diag([1.0, -1.0, -1.0]), np.array([0.3, -1.0, 130.0]), 1000.0, SIZE, (-2.0, 5.0))
LIGHT = np.zeros((9, 3))
LIGHT[:4] = np.array([0.75, -0.2, -0.25, -0.15])[:, None] * (1.0, 0.95, 0.9)

Pixels = NDArray[np.uint8]


def drawn(model: FaceModel, vertices: NDArray[np.floating]) -> tuple[Pixels, NDArray[np.bool_]]:
    """Return a photo of the face before a wall, and where it shows its front."""
    from faceposer.geometry.mesh import VertexNormals
    from faceposer.identity.photos.harmonics import harmonics

    posed = np.asarray(vertices, dtype=np.float64)
    surface = SurfaceInPicture.of(model.character, posed, CAMERA)
    normals = (
        VertexNormals(model.triangles, len(posed))(posed.astype(np.float32)).astype(np.float64) @ CAMERA.rotation.T
    )
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]]
    wall = np.stack([0.2 + 0.0005 * columns, 0.4 + 0.001 * rows, 0.7 - 0.0005 * columns], axis=2).reshape(-1, 3)
    shade = np.maximum(harmonics(normals) @ LIGHT, 0.1)
    wall[surface.at] = np.clip(surface.colours(model.character) * surface.of_vertices(shade), 0.0, 1.0)
    front = np.zeros(len(wall), dtype=bool)
    front[surface.at] = surface.of_vertices(-normals[:, 2:])[:, 0] > 0.4
    picture = (255.0 * wall + 0.5).astype(np.uint8).reshape(SIZE[1], SIZE[0], 3)
    return picture, ndimage.binary_erosion(front.reshape(SIZE[1], SIZE[0]), iterations=2)


def chin(head: HeadInPhoto, vertices: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the pixel of the grid that shows the bottom of the chin."""
    point = int(head.character.feature_points["2.1"])
    return head.camera.project(np.asarray(vertices, dtype=np.float64)[[point]])[0]


def blocks(model: FaceModel, weights: dict[str, float]) -> NDArray[np.float64]:
    """Return the vertices of the face with ``weights`` of its shapes."""
    return np.asarray(model.surface(model.coefficients_of(weights)), dtype=np.float64)


def shown(head: HeadInPhoto, vertices: NDArray[np.float64]) -> tuple[SurfaceInPicture, NDArray[np.int64]]:
    """Return the surface in the photo with ``vertices``, and the triangle at each of its pixels."""
    surface = SurfaceInPicture.of(head.character, vertices, head.camera)
    return surface, surface.faces[surface.at]


@pytest.fixture(scope="module")
def head(model: FaceModel) -> HeadInPhoto:
    picture, _ = drawn(model, model.surface(model.neutral()))
    return HeadInPhoto.of(model.character, model.surface(model.neutral()), CAMERA, picture, 300, "face.jpg")


def test_an_unchanged_face_gives_back_the_photo(model: FaceModel, head: HeadInPhoto) -> None:
    np.testing.assert_array_equal(put_back(head, model.surface(model.neutral())), head.pixels)


def test_the_light_of_the_photo_is_found(model: FaceModel, head: HeadInPhoto) -> None:
    from faceposer.identity.photos.harmonics import harmonics

    normals = head.normals_of(head.vertices)
    towards = normals[:, 2] < -0.5
    found, true = (harmonics(normals[towards]) @ light for light in (head.light, LIGHT))
    assert np.abs(found - true).mean() < 0.02 * true.mean()


@pytest.mark.parametrize(
    "weights",
    [
        {"mouthSmileLeft": 0.9, "mouthSmileRight": 0.9, "cheekSquintLeft": 0.6, "cheekSquintRight": 0.6},
        {"browDownLeft": 1.0, "browDownRight": 1.0, "mouthFrownLeft": 0.8, "mouthFrownRight": 0.8},
        {"jawOpen": 0.7},
    ],
    ids=["smile", "frown", "open"],
)
def test_a_changed_face_is_like_a_photo_of_it(model: FaceModel, head: HeadInPhoto, weights: dict[str, float]) -> None:
    vertices = model.surface(model.coefficients_of(weights))
    truth, front = drawn(model, vertices)
    made = put_back(head, vertices)
    # The neck below a jaw keeps the shadow of the photo, which this light does not cast.
    surface, _ = shown(head, np.asarray(vertices, dtype=np.float64))
    neck = surface.at[surface.of_vertices(head.behind[:, None])[:, 0] > 0.5]
    front.reshape(-1)[neck] = False
    before, after = (np.abs(image.astype(float) - truth)[front].mean() for image in (head.pixels, made))
    assert after < 0.45 * before
    # Far from the head, nothing changes.
    np.testing.assert_array_equal(made[:3], head.pixels[:3])


def test_teeth_appear_in_an_opened_mouth(model: FaceModel, head: HeadInPhoto) -> None:
    opened = model.surface(model.coefficients_of({"jawOpen": 0.7})).astype(np.float64)
    change = photo_change(head, opened)
    surface = SurfaceInPicture.of(model.character, opened, head.camera)
    inside = inside_of_mouth(model.character)[surface.faces[surface.at]]
    assert inside.sum() > 100
    assert change.drawn.reshape(-1)[surface.at[inside]].mean() > 0.9
    # No longer the skin of the closed lips, but teeth brighter than the dark behind them.
    colours = change.colours.reshape(-1, 3)[surface.at[inside]].mean(axis=1)
    assert np.quantile(colours, 0.95) > 2.0 * np.quantile(colours, 0.1)


def test_a_slimmer_head_leaves_no_hole(model: FaceModel, head: HeadInPhoto) -> None:
    middle = head.vertices.mean(axis=0)
    slim = (head.vertices - middle) * (0.9, 1.0, 1.0) + middle
    made = put_back(head, slim)
    surface = SurfaceInPicture.of(model.character, slim, CAMERA)
    shown = np.zeros(SIZE[0] * SIZE[1], dtype=bool)
    shown[surface.at] = True
    was = np.zeros_like(shown)
    full = SurfaceInPicture.of(model.character, head.vertices, CAMERA)
    was[full.at] = True
    uncovered = (was & ~shown).reshape(SIZE[1], SIZE[0])
    uncovered &= np.mgrid[: SIZE[1], : SIZE[0]][0] < 0.6 * SIZE[1]
    assert uncovered.sum() > 100
    # The wall moves in: it is blue, and skin and hair are not.
    colours = made[ndimage.binary_erosion(uncovered, iterations=1)].astype(int)
    assert ((colours[:, 2] > colours[:, 0]).mean()) > 0.9


def test_a_head_outside_the_photo_gets_one_sentence(model: FaceModel, head: HeadInPhoto) -> None:
    aside = Camera(CAMERA.rotation, CAMERA.translation + (60.0, 0.0, 0.0), CAMERA.focal, SIZE)
    with pytest.raises(FacePoserError, match=r"outside the photo 'face\.jpg'"):
        HeadInPhoto.of(model.character, head.vertices, aside, head.pixels, 300, "face.jpg")


def test_a_photo_of_unknown_expression_gets_one_sentence(model: FaceModel, tmp_path: Path) -> None:
    photo = Photo(str(tmp_path / "face.jpg"), SIZE, camera=CAMERA)
    with pytest.raises(FacePoserError, match="take its expression first"):
        head_in_photo(model, photo)


def test_the_expression_of_a_photo_is_kept_by_names_of_shapes(model: FaceModel) -> None:
    pose = model.coefficients_of({"jawOpen": 0.4, "mouthSmileLeft": 0.25})
    photo = Photo("face.jpg", SIZE).with_expression(model, pose)
    assert dict(photo.expression or ())["jawOpen"] == pytest.approx(0.4, abs=1e-5)
    found = photo.pose_of(model)
    assert found is not None
    np.testing.assert_allclose(found, pose, atol=1e-4)


def test_no_seam_shows_where_a_jaw_moves_over_the_neck(model: FaceModel, head: HeadInPhoto) -> None:
    """The photo's edge of the jaw is not exactly the model's; a jump of the offsets beside it would show it twice."""
    opened = blocks(model, {"jawOpen": 0.7})
    offsets = photo_change(head, opened).offsets
    column, bottom = (int(value) for value in chin(head, opened))
    fell = bottom - chin(head, head.vertices)[1]
    assert fell > 8.0
    near = offsets[bottom - 15 : bottom + 30, column - 40 : column + 41, 1]
    assert np.abs(np.diff(near, axis=0)).max() < 0.3 * fell
    # The edge moves along, and the cut of the neck stays.
    assert offsets[bottom, column, 1] == pytest.approx(-fell, abs=0.2 * fell)
    assert np.abs(offsets[-4:, column]).max() < 0.1 * fell


def test_the_light_of_the_wall_stays(model: FaceModel, head: HeadInPhoto) -> None:
    opened = blocks(model, {"jawOpen": 0.7})
    surface, _ = shown(head, opened)
    width, height = head.camera.size
    away = np.ones(width * height, dtype=bool)
    away[surface.at] = False
    wall = ndimage.binary_erosion(away.reshape(height, width), iterations=3)
    light = photo_change(head, opened).light
    assert np.abs(light[wall]).max() < 0.005
    assert np.abs(light).max() > 0.05


def test_the_fold_above_the_chin_is_no_inside_of_the_mouth(model: FaceModel, head: HeadInPhoto) -> None:
    _, triangles = shown(head, head.vertices)
    corners = model.triangles[triangles[inside_of_mouth(model.character)[triangles]]]
    middle = head.vertices[int(model.character.feature_points["2.3"]), 1]
    assert np.abs(head.vertices[corners.reshape(-1), 1] - middle).max(initial=0.0) < 0.05 * model.character.height


def test_opened_lips_do_not_show_the_line_between_them(model: FaceModel) -> None:
    neutral = np.asarray(model.surface(model.neutral()), dtype=np.float64)
    picture, _ = drawn(model, neutral)
    # A dark line, a little lower than the model's lips meet.
    points = model.character.feature_points
    left, right, middle = CAMERA.project(neutral[[int(points[name]) for name in ("2.4", "2.5", "2.2")]])
    low, high = sorted((int(left[0]), int(right[0])))
    row = round(float(middle[1])) + 1
    picture[row : row + 2, low - 2 : high + 3] = (60, 25, 20)
    head = HeadInPhoto.of(model.character, neutral, CAMERA, picture, 300, "face.jpg")
    opened = blocks(model, {"jawOpen": 0.7})
    made = put_back(head, opened)
    surface, triangles = shown(head, opened)
    inside = np.zeros(SIZE[0] * SIZE[1], dtype=bool)
    inside[surface.at[inside_of_mouth(model.character)[triangles]]] = True
    mouth = inside.reshape(SIZE[1], SIZE[0])
    assert mouth.sum() > 100
    lips = ndimage.binary_dilation(mouth, iterations=5) & ~ndimage.binary_dilation(mouth, iterations=2)
    usual = np.median(made[lips].mean(axis=1))
    assert (made[lips].mean(axis=1) < 0.65 * usual).mean() < 0.03


@pytest.mark.parametrize("lower", [0.0, 0.5], ids=["fitting", "off"])
def test_lips_that_close_show_no_teeth_of_the_photo(model: FaceModel, lower: float) -> None:
    smile = {"mouthLowerDownLeft": 0.5, "mouthLowerDownRight": 0.5, "mouthUpperUpLeft": 0.5, "mouthUpperUpRight": 0.5}
    smiling = blocks(model, {"jawOpen": 0.12, "mouthSmileLeft": 0.6, "mouthSmileRight": 0.6, **smile})
    picture, _ = drawn(model, smiling)
    # Teeth are white in the photo, and the model lies some pixels off it.
    surface = SurfaceInPicture.of(model.character, smiling, CAMERA)
    teeth = surface.at[inside_of_mouth(model.character)[surface.faces[surface.at]]]
    assert len(teeth) > 100
    picture.reshape(-1, 3)[teeth] = (235, 228, 215)
    off = smiling - (0.0, lower, 0.0)
    head = HeadInPhoto.of(model.character, off, CAMERA, picture, 300, "face.jpg")
    np.testing.assert_array_equal(put_back(head, off), picture)
    closed = np.asarray(model.surface(model.neutral()), dtype=np.float64) - (0.0, lower, 0.0)
    made = put_back(head, closed)
    surface, triangles = shown(head, closed)
    red = np.zeros(head.camera.size[0] * head.camera.size[1], dtype=bool)
    red[surface.at[head.red_of_lips[triangles]]] = True
    shape = (SIZE[1], SIZE[0])
    lips = red.reshape(head.camera.size[::-1])
    assert lips.shape == shape
    lips = ndimage.binary_erosion(lips)
    assert lips.sum() > 60
    # Teeth are far less saturated than lips.
    saturation = np.ptp(made[lips].astype(float), axis=1) / made[lips].max(axis=1)
    usual = np.ptp(picture[lips].astype(float), axis=1) / picture[lips].max(axis=1)
    assert saturation.min() > 0.6 * np.quantile(usual, 0.8)


def test_eyes_that_open_have_the_irises_of_the_photo(model: FaceModel, head: HeadInPhoto) -> None:
    picture = head.pixels.copy()
    eyes = head.eyes[head.surface.faces[head.surface.at]]
    colours = head.surface.colours(head.character)
    irises = head.surface.at[eyes & (colours.mean(axis=1) < 0.7)]
    assert len(irises) > 40
    rows, columns = np.divmod(irises, head.camera.size[0])
    picture[rows, columns] = (95, 55, 25)
    brown = HeadInPhoto.of(model.character, head.vertices, CAMERA, picture, 300, "face.jpg")
    wide = blocks(model, {"eyeWideLeft": 1.0, "eyeWideRight": 1.0})
    change = photo_change(brown, wide)
    surface, triangles = shown(brown, wide)
    new = head.eyes[triangles] & (change.drawn.reshape(-1)[surface.at] > 0.9)
    drawn_irises = surface.at[new & (np.abs(surface.colours(head.character).mean(axis=1) - 0.45) < 0.2)]
    assert len(drawn_irises) > 4
    red, green, blue = np.median(change.colours.reshape(-1, 3)[drawn_irises], axis=0)
    assert red > 1.15 * green > 1.3 * blue


def test_eyes_that_lids_had_covered_are_drawn_and_no_brighter_than_skin(model: FaceModel, head: HeadInPhoto) -> None:
    wide = blocks(model, {"eyeWideLeft": 1.0, "eyeWideRight": 1.0})
    surface, triangles = shown(head, wide)
    eyes = surface.at[head.eyes[triangles]]
    _, before = shown(head, head.vertices)
    covered = np.setdiff1d(eyes, head.surface.at[head.eyes[before]])
    assert len(covered) > 20
    change = photo_change(head, wide)
    assert change.drawn.reshape(-1)[covered].mean() > 0.8
    skin = head.picture.reshape(-1, 3)[head.surface.at[head.lids[before]]].mean(axis=1)
    assert change.colours.reshape(-1, 3)[covered].mean(axis=1).max() < 1.3 * np.median(skin)


def test_closed_lids_have_the_tone_of_the_skin_whatever_glasses_mirror(model: FaceModel, head: HeadInPhoto) -> None:
    picture = head.pixels.copy()
    _, triangles = shown(head, head.vertices)
    lids = head.surface.at[head.lids[triangles]]
    rows, columns = np.divmod(lids, SIZE[0])
    glare = columns % 7 < 2
    picture[rows[glare], columns[glare]] = 250
    mirrored = HeadInPhoto.of(model.character, head.vertices, CAMERA, picture, 300, "face.jpg")
    closed = blocks(model, {"eyeBlinkLeft": 1.0, "eyeBlinkRight": 1.0})
    made = put_back(mirrored, closed)
    surface, after = shown(head, closed)
    width = SIZE[0]
    lids = np.intersect1d(surface.at[head.lids[after]], head.surface.at[head.eyes[triangles]])
    assert len(lids) > 100
    upper = np.zeros(len(lids), dtype=bool)
    for eye in (lids % width < width // 2, lids % width >= width // 2):
        upper |= eye & (lids // width <= np.median(lids[eye] // width))
    difference = np.abs(made - put_back(head, closed).astype(float)).reshape(-1, 3).mean(axis=1)
    # The margins of lids, which are not stretched, are the photo's.
    assert difference[lids[upper]].mean() < 24.0


def test_all_grids_give_the_same_picture(model: FaceModel, head: HeadInPhoto) -> None:
    vertices = blocks(model, {"jawOpen": 0.8, "browInnerUp": 0.8})
    coarse = HeadInPhoto.of(model.character, head.vertices, CAMERA, head.pixels, 160, "face.jpg")
    fine = HeadInPhoto.of(model.character, head.vertices, CAMERA, head.pixels, 520, "face.jpg")
    pictures = [put_back(each, vertices).astype(float) for each in (coarse, head, fine)]
    changed = np.abs(pictures[1] - head.pixels).max(axis=2) > 4.0
    assert changed.mean() > 0.1
    for other in (pictures[0], pictures[2]):
        difference = np.abs(other - pictures[1]).mean(axis=2)
        assert difference[changed].mean() < 1.8
        assert (difference > 40.0).mean() < 1e-4


def test_clothes_stay_when_a_jaw_opens(model: FaceModel) -> None:
    """Below the head, the photo follows over a short distance only."""
    higher = Camera(CAMERA.rotation, CAMERA.translation + (0.0, -6.0, 30.0), CAMERA.focal, SIZE)
    neutral = np.asarray(model.surface(model.neutral()), dtype=np.float64)
    wall = np.full((SIZE[1], SIZE[0], 3), 128, dtype=np.uint8)
    head = HeadInPhoto.of(model.character, neutral, higher, wall, 300, "face.jpg")
    offsets = photo_change(head, blocks(model, {"jawOpen": 1.0})).offsets
    lowest = int(head.camera.project(head.vertices)[:, 1].max())
    assert lowest < head.camera.size[1] - 40
    assert np.abs(offsets).max() > 5.0
    assert not offsets[lowest + round(0.13 * head.head_height) :].any()


def test_glasses_do_not_move_with_the_brows(model: FaceModel) -> None:
    neutral = np.asarray(model.surface(model.neutral()), dtype=np.float64)
    picture, _ = drawn(model, neutral)
    plain = HeadInPhoto.of(model.character, neutral, CAMERA, picture.copy(), 300, "face.jpg")
    assert not glasses_in(plain).any()
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5
    frames = np.zeros(rows.shape, dtype=bool)
    for middle in CAMERA.project(plain.middles_of_lids):
        distance = np.hypot((columns - middle[0]) / 1.2, rows - middle[1] - 2.0)
        frames |= np.abs(distance - 16.0) < 1.5
    picture[frames] = (25, 20, 20)
    head = HeadInPhoto.of(model.character, neutral, CAMERA, picture, 300, "face.jpg")
    assert (glasses_in(head) & frames).sum() > 0.6 * frames.sum()
    raised = blocks(model, {"browInnerUp": 1.0, "browOuterUpLeft": 1.0, "browOuterUpRight": 1.0})
    made = put_back(head, raised)
    assert made[frames].mean() < 40.0
    forehead = CAMERA.project(neutral[model.character.regions["forehead"]]).mean(axis=0).astype(int)
    assert (
        made[forehead[1] - 8 : forehead[1] + 9, forehead[0]] != picture[forehead[1] - 8 : forehead[1] + 9, forehead[0]]
    ).any()
