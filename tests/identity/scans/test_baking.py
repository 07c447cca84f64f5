"""Colours of a scan in the layout of our heads."""

import io

import numpy as np
import pytest
from PIL import Image

from faceposer.geometry.mesh import TriangleMesh
from faceposer.identity.scans.baking import Layer, baked_layer, blended, has_colours
from faceposer.identity.scans.basis import HeadBasis
from faceposer.landmarks.drawing import PaintedMesh
from faceposer.model.character_file import load_character
from tests.identity.meshes import remeshed

SIDE = 2048


@pytest.fixture(scope="module")
def layer(basis: HeadBasis) -> Layer:
    """Return the colours of a scan of the mean's left half, which depend on the height."""
    man = load_character("man")
    mesh = remeshed(basis.mean, man.polygons[slice(*man.parts[0].polygons)])
    vertices = np.asarray(mesh.vertices)
    triangles = mesh.triangles[(vertices[mesh.triangles, 0] > 0.0).all(axis=1)]
    scan = TriangleMesh(vertices, triangles)
    return baked_layer(
        basis, man, basis.mean, basis.trust > 0.0, scan, PaintedMesh(vertices, triangles, colours(vertices))
    )


def colours(places: np.ndarray) -> np.ndarray:
    red = 120.0 + 5.0 * places[:, 1]
    return np.stack([red, np.full_like(red, 100.0), np.full_like(red, 60.0)], axis=1)


def pixels_of(basis: HeadBasis, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    man = load_character("man")
    uv_of = np.zeros((len(basis.mean), 2))
    uv_of[basis.triangles] = man.uv[man.triangle_uvs[: len(basis.triangles)]]
    at = np.stack([uv_of[vertices, 0], 1.0 - uv_of[vertices, 1]], axis=1) * SIDE
    columns, rows = np.clip(at.astype(int), 0, SIDE - 1).T
    return rows, columns


def test_vertices_have_their_colours(basis: HeadBasis, layer: Layer) -> None:
    chosen = np.flatnonzero((basis.trust > 0.95) & (basis.mean[:, 0] > 1.0))
    rows, columns = pixels_of(basis, chosen)
    assert layer.known[rows, columns].mean() > 0.95
    known = layer.known[rows, columns]
    expected = colours(basis.mean[chosen])
    assert np.abs(layer.colours[rows, columns] - expected)[known].mean() < 1.0
    other = np.flatnonzero((basis.trust > 0.95) & (basis.mean[:, 0] < -1.0))
    assert layer.known[pixels_of(basis, other)].mean() < 0.02


def test_the_other_half_gets_the_same_tone_without_a_seam(basis: HeadBasis, layer: Layer) -> None:
    skin = load_character("man").textures["skin"]
    data = blended([layer], skin)
    image = np.asarray(Image.open(io.BytesIO(data)).convert("RGB"), dtype=np.float64)
    assert image.shape == (SIDE, SIDE, 3)
    left = np.flatnonzero((basis.trust > 0.95) & (basis.mean[:, 0] > 2.0))
    right = np.flatnonzero((basis.trust > 0.95) & (basis.mean[:, 0] < -2.0))
    tones = [np.median(image[pixels_of(basis, half)], axis=0) for half in (left, right)]
    before = np.asarray(Image.open(io.BytesIO(skin)).convert("RGB"), dtype=np.float64)
    untouched = np.median(before[pixels_of(basis, right)], axis=0)
    assert np.abs(tones[0] - tones[1]).max() < 0.5 * np.abs(tones[0] - untouched).max()
    # Down the middle of the forehead, the colours of the two sides of the seam agree.
    rows, columns = pixels_of(basis, np.flatnonzero((np.abs(basis.mean[:, 0]) < 0.02) & (basis.trust > 0.95)))
    across = [image[rows, columns + shift].mean(axis=0) for shift in (-40, 40)]
    assert np.abs(across[0] - across[1]).max() < 12.0


def test_plain_meshes_have_no_colours() -> None:
    assert not has_colours(PaintedMesh(np.zeros((3, 3)), np.array([[0, 1, 2]])))
