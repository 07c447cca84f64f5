"""Compute the properties of texels and paint the textures of a character."""

import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage
from scipy.spatial import cKDTree

from faceposer.geometry.mesh import VertexNormals
from faceposer.identity.anatomy.loops import LASH_RING
from scripts.asset_building.creature_texture import HideLook, paint_hide
from scripts.asset_building.eye_texture import IrisLook, paint_eye, paint_lashes
from scripts.asset_building.head import Skin, split_uv
from scripts.asset_building.mouth_texture import paint_gums, paint_teeth, paint_throat, paint_tongue
from scripts.asset_building.occlusion import ambient_occlusion
from scripts.asset_building.piece import Floats, Ints
from scripts.asset_building.raster import map_texels, smoothstep
from scripts.asset_building.skin_texture import SkinLook, SkinTexels, paint_skin
from scripts.asset_building.source import Source
from scripts.asset_building.unwrap import Layout

SKIN_SIZE = 2048
_MASKS = {"lips": "lips", "eyelids": "eyelids", "ears": "ears", "inside": "inside-mouth"}

#: Depths, as z, between which the mouth's lining turns from dark to as bright as the inside of lips and cheeks.
_LINING_DEPTH = (7.5, 13.4)
#: Width of the transition to the colour of an ear at its root, in centimetres; step of the sampled texels.
_EAR_ROOT, _SPARSE = 1.3, 23


@dataclass(frozen=True)
class Look:
    """Colours of one character.

    Attributes:
        skin: A person's skin or a creature's hide.
        iris: The eyes.
        skin_size: Width and height of the skin's texture in pixels.
        eye_size: Width and height of the eye's texture in pixels.
        tongue_size: Width and height of the tongue's texture in pixels.
    """

    skin: SkinLook | HideLook
    iris: IrisLook
    skin_size: int = SKIN_SIZE
    eye_size: int = 1024
    tongue_size: int = 512


def skin_texels(source: Source, skin: Skin, rest: Floats, layout: Layout, size: int = SKIN_SIZE) -> SkinTexels:
    """Return the skin's texels in coordinates of the base mesh, valid for every person.

    Args:
        source: Source of the masks.
        skin: Topology of the skin.
        rest: The control mesh of the skin in the unmodified base mesh, in centimetres, shape (C, 3).
        layout: Texture layout of the control mesh.
        size: Width and height of the texture.
    """
    place = skin.fine.matrix @ rest
    triangles, uv, corner_uvs = _triangulated(skin.fine.quads, *split_uv(layout.uv, layout.quad_uvs))
    _, base_uv, base_corners = _triangulated(skin.fine.quads, *split_uv(skin.base_uv, skin.base_quad_uvs))
    normals = VertexNormals(triangles, len(place))(place).astype(np.float64)
    open_share = ambient_occlusion(place, skin.fine.quads, normals)
    edges = skin.fine.matrix @ np.stack(_lid_edges(skin), axis=1)
    attributes = np.concatenate(
        [per_vertex[triangles] for per_vertex in (place, normals, open_share[:, None])]
        + [base_uv[base_corners], edges[triangles]],
        axis=-1,
    )
    texels = map_texels(uv, corner_uvs, place[triangles], attributes, size)
    values = texels.values
    masks = {name: _look_up(source.mask(file), values[:, 7:9]) for name, file in _MASKS.items()}
    masks |= {"wet_line": values[:, 9], "lash_line": values[:, 10]}
    masks["behind_lips"] = smoothstep(*_LINING_DEPTH, values[:, 2])
    masks["free_ears"] = _free_ears(values[:, :3], masks["ears"])
    normal = values[:, 3:6] / np.maximum(np.linalg.norm(values[:, 3:6], axis=1, keepdims=True), 1e-6)
    return SkinTexels(texels, values[:, :3], normal, values[:, 6], masks)


def _free_ears(place: NDArray[np.float32], ears: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the weights of an ear at texels ``place`` (K, 3), rising softly from its root, 0..1, shape (K,)."""
    on_ear = np.flatnonzero((ears > 0.5) & (np.abs(place[:, 0]) > 6.0))
    beside = np.flatnonzero((ears <= 0.5) & (np.abs(place[:, 0]) > 5.0))[::_SPARSE]
    distance, _ = cKDTree(place[beside]).query(place[on_ear])
    free = np.zeros(len(place), dtype=np.float32)
    free[on_ear] = smoothstep(0.0, _EAR_ROOT, distance.astype(np.float32))
    return free


def vertex_masks(source: Source, skin: Skin) -> dict[str, Floats]:
    """Return the masks by name at the skin's fine vertices, 0..1, shape (N,); the largest value along seams."""
    uv, corners = split_uv(skin.base_uv, skin.base_quad_uvs)
    result = {}
    for name, file in _MASKS.items():
        values = np.zeros(skin.fine.matrix.shape[0])
        np.maximum.at(values, skin.fine.quads.ravel(), _look_up(source.mask(file), uv[corners.ravel()]))
        result[name] = values
    return result


def paint(texels: SkinTexels, look: Look) -> dict[str, bytes]:
    """Return the encoded textures by material, and that of the part "throat"; only human characters have lashes."""
    skin = paint_hide(texels, look.skin) if isinstance(look.skin, HideLook) else paint_skin(texels, look.skin)
    if look.skin_size != len(skin):
        size = (look.skin_size, look.skin_size)
        skin = np.asarray(Image.fromarray(skin).resize(size, Image.Resampling.LANCZOS))
    textures = {
        "skin": jpeg(skin, 88),
        "eye": jpeg(paint_eye(look.iris, look.eye_size), 92),
        "teeth": jpeg(paint_teeth(), 90),
        "gums": jpeg(paint_gums(), 90),
        "throat": jpeg(paint_throat(), 90),
        "tongue": jpeg(paint_tongue(look.tongue_size), 88),
    }
    if isinstance(look.skin, SkinLook):
        textures["lashes"] = _png(paint_lashes(look.skin.seed))
    return textures


def _triangulated(quads: Ints, uv: Floats, quad_uvs: Ints) -> tuple[Ints, Floats, Ints]:
    halves = [0, 1, 2, 0, 2, 3]
    return quads[:, halves].reshape(-1, 3), uv, quad_uvs[:, halves].reshape(-1, 3)


def _lid_edges(skin: Skin) -> tuple[Floats, Floats]:
    """Return the weights of the lids' wet inside and of their edge under the lashes for each control vertex."""
    wet, lash = np.zeros(len(skin.base_ids)), np.zeros(len(skin.base_ids))
    for k, left in enumerate(skin.rings_left[: LASH_RING + 2]):
        for ring in (left, skin.mirror[left]):
            wet[ring] = float(k < LASH_RING)
            lash[ring] = {LASH_RING: 1.0, LASH_RING - 1: 0.5, LASH_RING + 1: 0.5}.get(k, 0.0)
    return wet, lash


def _look_up(mask: NDArray[np.float32], uv: NDArray[np.float32]) -> NDArray[np.float32]:
    at = [(1.0 - uv[:, 1]) * mask.shape[0] - 0.5, uv[:, 0] * mask.shape[1] - 0.5]
    found: NDArray[np.float32] = ndimage.map_coordinates(mask, at, order=1, mode="nearest")
    return found


def jpeg(image: NDArray[np.uint8], quality: int) -> bytes:
    """Return ``image``, shape (H, W, 3), encoded."""
    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, "JPEG", quality=quality, subsampling=0, optimize=True)
    return buffer.getvalue()


def _png(image: NDArray[np.uint8]) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, "PNG", optimize=True)
    return buffer.getvalue()
