"""The texture of a head from photos of it, free of their light (Blanz and Vetter 1999, section 4.1).

Every texel of the face that a photo sees gets its colour there without the light that was found. Photos are mixed by
how directly they see it; where none does, the mirrored side is taken, then the texture model. Colours that no skin
under that light has, as of hair over the forehead, of glasses, of teeth and of highlights, do not count. What is seen
is blended with the model's skin band by band (`skin_bands`).
"""

import io
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.errors import FacePoserError
from faceposer.geometry.texture_images import DECODER_ERRORS
from faceposer.identity.photos.face_places import FacePlaces
from faceposer.identity.photos.face_texels import SIDE, Texels, face_texels, smooth_step
from faceposer.identity.photos.glasses import DISTINCT, DISTINCT_PAINTED
from faceposer.identity.photos.head_basis import HeadBasis
from faceposer.identity.photos.skin_bands import blended_difference
from faceposer.identity.photos.unlit_colours import LitPhoto, unlit_colours
from faceposer.identity.skin_layers import BROW_STYLES, Colour
from faceposer.identity.texture_model import TextureModel, load_texture_model

Array = NDArray[np.float64]
Image32 = NDArray[np.float32]

# Side of the texture.
_TEXTURE = 2048
# Cosines between the surface and the view between which detail, which is stretched where skin is seen from the side,
# begins to count and counts fully.
_SHARP = (0.35, 0.7)
# Colour below which logarithms are not told apart.
_BLACK = 0.02
# Logarithm by which smooth colours differ from the model's where they cannot be of the skin.
_FOREIGN, _FOREIGN_BLUR = 0.3, 6.0
# Least half width of large areas of hair, and reach of strands beside them, in texels.
_LARGE, _STRANDS = 14, (12.0, 24.0)
# Logarithms of red over green, relative to the model's lips, between which what lies on lips is teeth and lip.
_TEETH = (-0.28, -0.14)
# Weight of the mirrored side relative to the own one.
_MIRRORED = 0.02
_LEAST = 0.004
# Blur in texels below which detail, as pores, is the model's: photos show none of it.
_PORES = 1.5
_QUALITY = 92
# Share of the brows that must be seen, that glasses may cover, and size in texels of what is left out about lost ones.
_BROWS_SEEN, _BROWS_WORN, _BROW_MARGIN = 0.5, 0.15, 9
# Least number of texels of brows whose colour counts; quantile of their brightness below which they are hairs, and
# the share of the colour of hairs in that, as skin shines through.
_LEAST_BROWS, _HAIRS, _HAIR_SHADE = 100, 0.3, 0.75
# Logarithms of the chroma of smooth colours over the model's, apart from lips, between which they are no skin's.
_TINTED = (0.15, 0.30)


@dataclass(frozen=True, eq=False)
class Zones:
    """Where the model has other than bare skin, as shares of each texel of the grid, 0 to 1, shape (side, side).

    Attributes:
        lips: Lips.
        brows: Hairs of brows of any style.
        near_brows: Brows and what is about them.
        hair: Hair of one style.
    """

    lips: Image32
    brows: Image32
    near_brows: Image32
    hair: Image32

    @classmethod
    def of(cls, model: TextureModel, hair: str) -> "Zones":
        """Return the zones of a texture ``model`` with a style of ``hair``."""
        covered = [1.0 - model.layer(f"brows.{style}", SIDE)[0] for style in BROW_STYLES if style != "none"]
        brows = np.max(covered, axis=0).astype(np.float32)
        wide = ndimage.maximum_filter(np.minimum(2.0 * brows, 1.0), _BROW_MARGIN)
        near = ndimage.gaussian_filter(wide, _BROW_MARGIN / 3.0)
        scalp = np.zeros_like(brows) if hair == "none" else (1.0 - model.layer(f"hair.{hair}", SIDE)[0])
        return cls(model.mask("lips", SIDE).astype(np.float32), brows, near, scalp.astype(np.float32))


@dataclass(frozen=True, eq=False)
class SeenSkin:
    """The skin that photos show, compared with that of the model.

    Attributes:
        zones: Lips, brows and hair of the model.
        difference: Logarithms of the colours over the model's, shape (side, side, 3).
        trust: How much each texel of the grid is seen, 0 to 1, shape (side, side).
        sharp: Factor on the trust in details, 0 to 1, shape (side, side).
        worn: Where glasses lie in all photos, 0 to 1, shape (side, side).
        painted: All of it is kept, as of a painting.
        brow_colour: Colour of what is seen of the brows, sRGB 0 to 1, or None if too little is.
    """

    zones: "Zones"
    difference: Image32
    trust: Image32
    sharp: Image32
    worn: Image32
    painted: bool
    brow_colour: Colour | None

    @property
    def brows_lost(self) -> bool:
        """True if too little of the brows is seen, as under frames of glasses."""
        on_brows = self.zones.brows > 0.5
        seen, worn = (
            float((plane[on_brows] > 0.5).mean()) if on_brows.any() else 1.0 for plane in (self.trust, self.worn)
        )
        return seen < _BROWS_SEEN or worn > _BROWS_WORN

    def without_brows(self) -> "SeenSkin":
        """Return the skin with nothing seen at the brows."""
        return replace(self, trust=self.trust * (1.0 - self.zones.near_brows))

    def over(self, under: bytes) -> bytes:
        """Return the encoded texture, JPEG, with this skin over the encoded texture ``under`` of the model.

        Raises:
            FacePoserError: If ``under`` cannot be decoded.
        """
        from PIL import Image

        zones = self.zones
        free = np.maximum(zones.near_brows, zones.lips)
        logs = blended_difference(self.difference, self.trust, self.sharp, free, limited=not self.painted)
        logs *= np.maximum(1.0 - zones.hair, self.trust)[..., None]
        picture = _picture(under, _TEXTURE)
        image = np.empty((_TEXTURE, _TEXTURE, 3), dtype=np.uint8)
        # One channel at a time, for the memory's sake.
        for channel in range(3):
            factors = ndimage.zoom(logs[..., channel], _TEXTURE // SIDE, order=1, grid_mode=True, mode="nearest")
            np.exp(factors, out=factors)
            factors *= picture[..., channel]
            image[..., channel] = np.rint(np.clip(factors, 0.0, 255.0, out=factors), out=factors)
        out = io.BytesIO()
        Image.fromarray(image).save(out, format="JPEG", quality=_QUALITY, subsampling=0)
        return out.getvalue()


def photo_texture(
    photos: Iterable[LitPhoto], under: bytes, basis: HeadBasis, places: FacePlaces, tolerance: float = 1.0
) -> bytes:
    """Return the encoded texture, JPEG, of a head in ``photos``, over the encoded texture ``under`` of the model.

    Colours that differ more than skin under one light does, times ``tolerance``, are left out.

    Raises:
        FacePoserError: If ``under`` cannot be decoded.
    """
    return seen_skin(photos, under, basis, places, Zones.of(load_texture_model(), "none"), tolerance).over(under)


def seen_skin(
    photos: Iterable[LitPhoto],
    under: bytes,
    basis: HeadBasis,
    places: FacePlaces,
    zones: Zones,
    tolerance: float = 1.0,
    painted: bool = False,
) -> SeenSkin:
    """Return the skin in ``photos``, own and mirrored, compared with the encoded texture ``under`` of the model.

    Args:
        photos: The photos.
        under: The model's texture without brows.
        basis: The model of heads.
        places: Places of the landmarks.
        zones: Lips, brows and hair of the model.
        tolerance: Factor on the difference of colours up to which they are taken for skin.
        painted: The photos are paintings, whose colours are kept as they are.

    Raises:
        FacePoserError: If ``under`` cannot be decoded.
    """
    texels = face_texels(basis, places)
    model = _picture(under, SIDE).astype(np.float64) / 255.0
    smooth = np.log(np.maximum(ndimage.gaussian_filter(model, (_PORES, _PORES, 0.0)), _BLACK)).reshape(-1, 3)[texels.at]
    on_lips = zones.lips.ravel()[texels.at].astype(np.float64)
    total, share, direct = (np.zeros((SIDE * SIDE, k), dtype=np.float32) for k in (3, 1, 1))
    worn = np.zeros(SIDE * SIDE, dtype=np.float32)
    worn[texels.at] = 1.0
    for photo in photos:
        colours, weights, facing = unlit_colours(photo, texels, basis)
        logs = np.log(np.maximum(colours, _BLACK)) - smooth
        plausible, usual = _plausible(logs, weights, texels, on_lips, tolerance)
        bare = texels.front.kept(logs - usual, weights, DISTINCT_PAINTED if painted else DISTINCT)
        bare = np.ones(len(weights)) if bare is None else bare
        worn[texels.at] *= 1.0 - bare
        weights = weights * bare * plausible * _no_teeth(logs, weights, on_lips)
        weighted = weights[:, None]
        total[texels.at] += weighted * logs
        share[texels.at] += weighted
        direct[texels.at] += weighted * smooth_step(facing, _SHARP)[:, None]
    opposite, other = total[texels.mirror], share[texels.mirror]
    sharp = direct / np.maximum(share, 1e-6)
    trust = np.minimum(share, 1.0)
    trust[texels.at] = np.maximum(trust[texels.at], np.minimum(other, 1.0))
    sharp[texels.at] = np.where(share[texels.at] > _LEAST, sharp[texels.at], sharp[texels.mirror])
    total[texels.at] += _MIRRORED * opposite
    share[texels.at] += _MIRRORED * other
    total /= np.maximum(share, 1e-9)
    at_brows = (zones.brows.ravel()[texels.at] > 0.5) & (share[texels.at, 0] > 0.5)
    brows = _brow_colour(np.exp(total[texels.at] + smooth)[at_brows])
    return SeenSkin(
        zones,
        total.reshape(SIDE, SIDE, 3),
        trust.reshape(SIDE, SIDE),
        sharp.astype(np.float32).reshape(SIDE, SIDE),
        worn.reshape(SIDE, SIDE),
        painted,
        brows,
    )


def _brow_colour(colours: Array) -> Colour | None:
    """Return the colour of hairs among those of brows, (n, 3), which skin shines through."""
    if len(colours) < _LEAST_BROWS:
        return None
    brightness = colours.mean(axis=1)
    dark = colours[brightness <= np.quantile(brightness, _HAIRS)]
    red, green, blue = np.clip(_HAIR_SHADE * np.median(dark, axis=0), 0.0, 1.0).tolist()
    return (red, green, blue)


def _usual(logs: Array, weights: Array) -> Array:
    result: Array = np.median(logs[weights > 0.5], axis=0) if (weights > 0.5).any() else np.zeros(3)
    return result


def _plausible(logs: Array, weights: Array, texels: Texels, lips: Array, tolerance: float) -> tuple[Array, Array]:
    """Return factors on the weights of texels, less where smooth colours are not of this skin, (n,), and usual ones."""
    blurred = np.zeros((SIDE * SIDE, 4), dtype=np.float32)
    blurred[texels.at, :3] = logs * weights[:, None]
    blurred[texels.at, 3] = weights
    sigma = (_FOREIGN_BLUR, _FOREIGN_BLUR, 0.0)
    grid = ndimage.gaussian_filter(blurred.reshape(SIDE, SIDE, 4), sigma).reshape(-1, 4)
    smooth = grid[texels.at, :3] / np.maximum(grid[texels.at, 3:], 1e-6)
    usual = _usual(smooth, weights)
    off = np.abs(smooth - usual).max(axis=1) / tolerance
    foreign = smooth_step(off, (_FOREIGN, 2.0 * _FOREIGN))
    chroma = smooth - usual
    chroma = np.abs(chroma - chroma.mean(axis=1, keepdims=True)).max(axis=1) / tolerance
    foreign = np.maximum(foreign, (1.0 - lips) * smooth_step(chroma, _TINTED))
    result: Array = np.maximum(1.0 - np.maximum(foreign, _beside(foreign, weights, texels)), texels.brows)
    return result, usual


def _no_teeth(logs: Array, weights: Array, lips: Array) -> Array:
    """Return factors on the weights of texels, (n,): less where ``lips``, (n,), lack the model's red, as teeth do."""
    redness = logs[:, 0] - logs[:, 1]
    skin = (weights > 0.5) & (lips < 0.1)
    if not skin.any():
        return np.ones(len(lips))
    result: Array = 1.0 - lips * (1.0 - smooth_step(redness - np.median(redness[skin]), _TEETH))
    return result


def _beside(foreign: Array, weights: Array, texels: Texels) -> Array:
    """Return how much texels lie beside large areas that are not of the skin, as strands beside hair, (n,)."""
    grid = np.zeros(SIDE * SIDE, dtype=bool)
    grid[texels.at] = (foreign > 0.9) & (weights > 0.0)
    large = ndimage.binary_opening(grid.reshape(SIDE, SIDE), iterations=_LARGE)
    distance = ndimage.distance_transform_edt(~large) if large.any() else np.full(large.shape, np.inf)
    result: Array = 1.0 - smooth_step(distance.ravel()[texels.at], _STRANDS)
    return result


def _picture(encoded: bytes, side: int) -> NDArray[np.uint8]:
    """Return an encoded texture, 0 to 255, shape (side, side, 3).

    Raises:
        FacePoserError: If it cannot be decoded.
    """
    from PIL import Image

    try:
        with Image.open(io.BytesIO(encoded)) as picture:
            image = picture.convert("RGB")
            if image.size != (side, side):
                image = image.resize((side, side), Image.Resampling.BOX)
            return np.asarray(image)
    except (OSError, *DECODER_ERRORS) as error:
        raise FacePoserError("The skin of the model cannot be read; install Face Poser again.") from error
