"""The skin of photos with glasses."""

import io
from collections.abc import Callable

import numpy as np
import pytest
from PIL import Image, ImageDraw

from faceposer.identity.photos.face_places import FacePlaces
from faceposer.identity.photos.face_texels import face_texels
from faceposer.identity.photos.head_basis import HeadBasis
from faceposer.identity.photos.photo_texture import Zones, photo_texture, seen_skin
from faceposer.identity.photos.unlit_colours import LitPhoto, unlit_colours
from faceposer.identity.texture_model import load_texture_model
from tests.identity.photos.sitting import Draw, Sitting


def _glasses(colour: tuple[int, int, int], width: int) -> Draw:
    def draw(pen: ImageDraw.ImageDraw, project: Callable[[np.ndarray], list[tuple[float, float]]]) -> None:
        turn = np.linspace(0.0, 2.0 * np.pi, 60)
        for side in (-1.0, 1.0):
            ring = [side * (3.1 + 2.3 * np.cos(turn)), 1.6 + 2.1 * np.sin(turn), np.full(60, 8.8)]
            pen.line(project(np.stack(ring, axis=1)), fill=colour, width=width, joint="curve")
            pen.line(project(np.array([[side * 5.4, 2.2, 8.8], [side * 7.0, 2.4, 7.0]])), fill=colour, width=width)
        pen.line(project(np.array([[-0.8, 2.0, 9.0], [0.0, 2.3, 9.4], [0.8, 2.0, 9.0]])), fill=colour, width=width)

    return draw


def _over_brows(pen: ImageDraw.ImageDraw, project: Callable[[np.ndarray], list[tuple[float, float]]]) -> None:
    _glasses((35, 25, 25), 9)(pen, project)
    across = np.linspace(-2.2, 2.2, 20)
    for side in (-1.0, 1.0):
        bar = [side * (3.1 + across), 3.6 - 0.08 * across**2, np.full(20, 8.8)]
        pen.line(project(np.stack(bar, axis=1)), fill=(35, 25, 25), width=26, joint="curve")


def _moles(pen: ImageDraw.ImageDraw, project: Callable[[np.ndarray], list[tuple[float, float]]]) -> None:
    for x, y in project(np.array([[3.0, -0.6, 8.8], [-2.5, -0.9, 9.0], [-4.5, -1.5, 8.0], [0.5, 4.5, 9.4]])):
        pen.ellipse([x - 5.0, y - 5.0, x + 5.0, y + 5.0], fill=(70, 45, 40))


def _decoded(encoded: bytes) -> np.ndarray:
    picture = Image.open(io.BytesIO(encoded)).convert("RGB").resize((1024, 1024))
    return np.asarray(picture, dtype=np.float64).reshape(-1, 3)


def _kept(photo: LitPhoto, under: bytes, basis: HeadBasis, places: FacePlaces) -> tuple[np.ndarray | None, np.ndarray]:
    """Return the factors of glasses, and the colours of the texels."""
    texels = face_texels(basis, places)
    colours, weights, _ = unlit_colours(photo, texels, basis)
    logs = np.log(np.maximum(colours, 0.02)) - np.log(np.maximum(_decoded(under)[texels.at] / 255.0, 0.02))
    return texels.front.kept(logs - np.median(logs[weights > 0.5], axis=0), weights), colours


def test_frames_are_replaced_by_skin(sitting: Sitting, under: bytes, basis: HeadBasis, places: FacePlaces) -> None:
    worn, bare = sitting.photo(_glasses((35, 25, 25), 9)), sitting.photo()
    texels = face_texels(basis, places)
    colours, weights, _ = unlit_colours(bare, texels, basis)
    truth = 255.0 * colours
    difference = np.abs(255.0 * unlit_colours(worn, texels, basis)[0] - truth).max(axis=1)
    frame, free = (difference > 25.0) & (weights > 0.9), (difference < 2.0) & (weights > 0.9)
    assert frame.sum() > 5000
    errors = np.abs(_decoded(photo_texture([worn], under, basis, places))[texels.at] - truth).max(axis=1)
    skin, brows = frame & (texels.brows < 0.1), texels.brows > 0.9
    assert difference[skin].mean() > 35.0
    assert errors[skin].mean() < 4.0
    # What the frames do not cover is as without them, most of the brows too.
    assert errors[free].mean() < 3.0
    assert np.median(errors[brows]) < 8.0


def test_thin_frames_of_about_the_colour_of_the_skin_are_found(
    sitting: Sitting, under: bytes, basis: HeadBasis, places: FacePlaces
) -> None:
    kept, colours = _kept(sitting.photo(_glasses((120, 75, 35), 6)), under, basis, places)
    _, bare = _kept(sitting.photo(), under, basis, places)
    assert kept is not None
    texels = face_texels(basis, places)
    frame = (np.abs(colours - bare).max(axis=1) > 0.1) & (texels.brows < 0.1) & (texels.region > 0.9)
    assert frame.sum() > 2000
    assert kept[frame].mean() < 0.1


@pytest.mark.parametrize("draw", [None, _moles])
def test_brows_stubble_and_moles_are_no_glasses(
    sitting: Sitting, under: bytes, basis: HeadBasis, places: FacePlaces, draw: Draw | None
) -> None:
    assert _kept(sitting.photo(draw), under, basis, places)[0] is None


def test_no_glasses_are_printed_into_paintings(
    sitting: Sitting, under: bytes, basis: HeadBasis, places: FacePlaces
) -> None:
    zones, texels = Zones.of(load_texture_model(), "short"), face_texels(basis, places)
    worn, bare = (sitting.photo(draw) for draw in (_glasses((35, 25, 25), 9), None))
    drawn = np.abs(worn.image - bare.image).max(axis=2)
    seen = seen_skin([worn], under, basis, places, zones, 1.8, painted=True)
    places_in_photo = np.floor(worn.camera.pixels(worn.camera.local(texels.of_vertices(worn.vertices)))).astype(int)
    columns, rows = np.clip(places_in_photo.T, 0, np.array(drawn.shape)[::-1, None] - 1)
    frame = (drawn[rows, columns] > 0.2) & (texels.region > 0.9) & (texels.brows < 0.1)
    assert frame.sum() > 2000
    assert np.median(seen.trust.ravel()[texels.at][frame]) == 0.0
    logs = seen.difference[seen.trust > 0.5].mean(axis=1)
    assert (logs < -0.8).mean() < 0.002


def test_brows_under_frames_are_lost(sitting: Sitting, under: bytes, basis: HeadBasis, places: FacePlaces) -> None:
    zones = Zones.of(load_texture_model(), "short")
    lost = [seen_skin([sitting.photo(draw)], under, basis, places, zones).brows_lost for draw in (None, _over_brows)]
    assert lost == [False, True]
