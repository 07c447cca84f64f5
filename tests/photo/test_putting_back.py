"""Heads put back into photos that were drawn from them, so that the changed photo is known."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
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
