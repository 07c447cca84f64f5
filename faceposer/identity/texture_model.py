"""A linear model of skin textures, with hair, brows, stubble and lips as layers of their own colours.

A texture is exp(mean + Σ c_i mode_i) in the skin's own layout, equation (1) of Blanz and Vetter (SIGGRAPH 1999) for the
logarithms of the colours. The first mode is the tone, on a scale that `skin_tones` keeps within human skin. A layer of
hairs turns the colour s below into T s + H h with the colour h of the hairs, their transmission T and their shade H.
"""

import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from faceposer.errors import FacePoserError
from faceposer.identity.companion_file import read_companion, unusable
from faceposer.identity.skin_layers import FOLDS, FOLDS_SHARE, Colour, Layer, SkinLayers, painted
from faceposer.identity.skin_tones import below_white, limited_brightness, limited_chroma, line_tone, scale_tone
from faceposer.resources import asset_path

Array = NDArray[np.float64]
Image32 = NDArray[np.float32]

FORMAT, NOUN = "faceposer.textures", "texture model"
#: Width and height of the textures, and of the grid on which they are compared.
SIZE, _COARSE = 2048, 256
#: Largest natural coefficient.
LIMIT = 2.5
#: Deviation of the pores, and side of the square that repeats, in pixels.
_PORES, _TILE = 0.026, 256
#: Deviation of the creases of the lips.
_CREASES = 0.03
#: Largest colour of brows whose colour is not given, as a share of the skin's.
_BROWS_BELOW = 0.4
#: Transmission in 8 bits above which a layer shows no hair.
_BARE = 244
#: Deviation of a texture's coarse logarithms apart from the model.
_NOISE = 0.05
#: Logarithm by which full redness changes the colour of the lips.
LIPSTICK = np.array([0.05, -0.55, -0.35])
#: Part of the texture with the face: first and last row and column, as shares.
_FACE = (0.22, 0.86, 0.25, 0.75)
#: Density of the brows of average skin in `log_basis`, and standard deviations of redness and densities there.
_USUAL_BROWS, _LIPS_SPREAD, _BROWS_SPREAD, _STUBBLE_SPREAD = 0.7, 0.4, 0.4, 0.25
_CHANNELS = ("luma", "red", "blue")
_TILES = [
    (slice(row, row + _TILE), slice(column, column + _TILE))
    for row in range(0, SIZE, _TILE)
    for column in range(0, SIZE, _TILE)
]
_INVALID = (AttributeError, IndexError, KeyError, OSError, SyntaxError, TypeError, ValueError)


@dataclass(frozen=True, eq=False)
class TextureModel:
    """A mean skin with modes, and layers.

    Attributes:
        luma: Brightness, the mean of the logarithms of the channels, of the mean and the K modes, shape
            (1 + K, 1024, 1024).
        chroma: Logarithms of red and blue minus brightness, shape (1 + K, 2, 256, 256).
        lips: Logarithms of the colour of lips relative to skin, of the mean and the modes, shape (1 + K, 3).
        labels: Change of a label per unit of the coefficients: "age" (old is 1 more than young) and "gender" (women are
            2 more than men), both 0 for the mean, shape (K,).
        skins: Coefficients of the skins that the model was learned from, by name, shape (K,).
        layers: Encoded images of the layers by name.
        credits: Where the skins come from.
    """

    luma: Image32
    chroma: Image32
    lips: Array
    labels: Mapping[str, Array]
    skins: Mapping[str, Array]
    layers: Mapping[str, bytes] = field(repr=False)
    credits: str = ""

    @property
    def n_coefficients(self) -> int:
        """Number K of modes."""
        return len(self.lips) - 1

    def sample(self, seed: int, n: int = 1) -> Array:
        """Return coefficients of ``n`` random skins, shape (n, K), in standard deviations."""
        drawn = np.random.default_rng(seed).standard_normal((n, self.n_coefficients))
        result: Array = np.clip(drawn, -LIMIT, LIMIT)
        return result

    def tone(self, coefficients: ArrayLike) -> float:
        """Return the tone, in standard deviations: negative light, positive dark."""
        return float(self._checked(coefficients)[0])

    def with_tone(self, coefficients: ArrayLike, tone: float) -> Array:
        """Return ``coefficients`` with another tone; nothing else changes."""
        result = self._checked(coefficients).copy()
        result[0] = tone
        return result

    def label(self, coefficients: ArrayLike, name: str) -> float:
        """Return "age" or "gender" of a skin relative to the mean, as regressed on the skins' names."""
        return float(self.labels[name] @ self._checked(coefficients))

    def with_label(self, coefficients: ArrayLike, name: str, value: float) -> Array:
        """Return the nearest coefficients with "age" or "gender" of ``value``; tone and the other label are kept."""
        given = self._checked(coefficients)
        slopes = np.stack([self.labels[name], *(slope for other, slope in self.labels.items() if other != name)])
        rows = np.concatenate([slopes, np.eye(1, self.n_coefficients)])
        missing = np.zeros(len(rows))
        missing[0] = value - self.label(given, name)
        result: Array = given + np.linalg.pinv(rows) @ missing
        return result

    def instance(
        self, coefficients: ArrayLike, layers: SkinLayers | None = None, size: int = SIZE
    ) -> NDArray[np.uint8]:
        """Return a texture.

        Args:
            coefficients: c in standard deviations, shape (K,).
            layers: Hair, brows and so on; the usual ones if None.
            size: Width and height of the image.

        Returns:
            sRGB colours, first row at v = 1, shape (size, size, 3).

        Raises:
            FacePoserError: If there are not K finite coefficients.
        """
        c = self._on_line(coefficients)
        style = layers or SkinLayers()
        luma, (red, blue) = self._logs(c)
        hairs = self._hairs(style, np.exp([np.median(luma) + np.median(plane) for plane in (red, -red - blue, blue)]))
        luma, red, blue = (_resized(plane, SIZE) for plane in (luma, red, blue))
        lips = (c @ self.lips + style.lip_redness * LIPSTICK).astype(np.float32)
        texture = np.empty((SIZE, SIZE, 3), dtype=np.uint8)
        for place in _TILES:
            brightness = luma[place] + self._pores * self._grain[place]
            masks = self._masks.at(place)
            over = [(name, layer.at(place), colour, density) for name, layer, colour, density in hairs]
            for k, chroma in enumerate((red[place], -(red[place] + blue[place]), blue[place])):
                texture[*place, k] = painted(
                    k, brightness + chroma, lips[k], masks, over, style.lash_line, self._creases
                )
        if size == SIZE:
            return texture
        return np.asarray(Image.fromarray(texture).resize((size, size), Image.Resampling.LANCZOS))

    def encoded(self, coefficients: ArrayLike, layers: SkinLayers | None = None, size: int = SIZE) -> bytes:
        """Return `instance` as a JPEG file, as characters have it."""
        buffer = io.BytesIO()
        picture = Image.fromarray(self.instance(coefficients, layers, size))
        picture.save(buffer, "JPEG", quality=90, subsampling=0)
        return buffer.getvalue()

    def project(self, texture: ArrayLike, mask: ArrayLike | None = None) -> Array:
        """Return the maximum a posteriori coefficients of a texture, shape (K,), from the bare skin of its face.

        Args:
            texture: sRGB colours, 0..255, in the skin's layout, shape (H, W, 3).
            mask: Share of each texel that shows skin, 0..1, shape (H, W); all of them if None.

        Raises:
            FacePoserError: If a shape is wrong, or no texel of the face shows skin.
        """
        colours = np.asarray(texture, dtype=np.float32)
        if colours.ndim != 3 or colours.shape[2] != 3 or not np.isfinite(colours).all():
            raise FacePoserError("A texture must have finite colours in three channels.")
        weight, basis = self._coarse
        if mask is not None:
            share = np.asarray(mask, dtype=np.float32)
            if share.shape != colours.shape[:2] or not np.isfinite(share).all():
                raise FacePoserError("The mask of a texture must have its size, and finite numbers.")
            weight = weight * np.clip(_resized(share, _COARSE), 0.0, 1.0)
        if weight.sum() < 1e-3 * weight.size:
            raise FacePoserError("The texture shows too little bare skin of the face.")
        logs = np.stack([_resized(np.log(np.maximum(colours[..., k], 3.0) / 255.0), _COARSE) for k in range(3)])
        # Neighbouring texels err alike, so that they count as one measurement for each patch of 8 x 8.
        rows = (basis * np.sqrt(weight / 64.0)).reshape(len(basis), -1)
        seen = (logs * np.sqrt(weight / 64.0)).ravel() - rows[0]
        gram = rows[1:] @ rows[1:].T / _NOISE**2 + np.eye(self.n_coefficients)
        return self.of_line(np.linalg.solve(gram, rows[1:] @ seen / _NOISE**2))

    def of_line(self, coefficients: ArrayLike) -> Array:
        """Return the coefficients of a skin from those of `log_basis`, where the tone is not compressed, shape (K,)."""
        result = self._checked(coefficients).copy()
        result[0] = scale_tone(result[0])
        return result

    def log_basis(self, size: int) -> tuple[Image32, Image32]:
        """Return logarithms of the colour of skin with lips and brows, without hair, pores and creases.

        Args:
            size: Width and height of the images, in pixels.

        Returns:
            The mean, shape (3, size, size), and the K modes followed by the redness of the lips and the densities of
            brows and stubble, each in standard deviations of people, shape (K + 3, 3, size, size).
        """
        luma = np.stack([_resized(image, size) for image in self.luma])
        red, blue = (np.stack([_resized(image, size) for image in self.chroma[:, k]]) for k in (0, 1))
        logs = np.stack([luma + red, luma - red - blue, luma + blue], axis=1)
        lips, folds = (_resized(self._masks.planes[k] / np.float32(255.0), size) for k in (0, 5))
        logs += lips * self.lips[:, :, None, None].astype(np.float32)
        brows, stubble = (
            np.log(np.maximum(_resized(self._hair_layer(name).planes[0] / np.float32(255.0), size), 0.1))
            for name in ("brows.straight", "beard")
        )
        logs[0] += brows * np.float32(_USUAL_BROWS)
        logs[0] += np.log(np.maximum(folds, 0.02)) * (FOLDS * FOLDS_SHARE)[:, None, None]
        redness = _LIPS_SPREAD * lips * LIPSTICK[:, None, None]
        dark = np.ones((3, 1, 1))
        further = np.stack([redness, _BROWS_SPREAD * brows * dark, _STUBBLE_SPREAD * stubble * dark])
        return logs[0], np.concatenate([logs[1:], further.astype(np.float32)])

    def layer(self, name: str, size: int) -> tuple[Array, Array]:
        """Return transmission and shade of a layer of hairs such as "beard" or "hair.short", 0..1, (size, size)."""
        transmission, shade = (
            _resized(plane / np.float32(255.0), size).astype(np.float64) for plane in self._hair_layer(name).planes
        )
        return transmission, shade

    def mask(self, name: str, size: int) -> Array:
        """Return the share of each texel that is on the "lips" or on the edges with "lashes", (size, size)."""
        plane = self._masks.planes[{"lips": 0, "lashes": 2}[name]]
        return _resized(plane / np.float32(255.0), size).astype(np.float64)

    def _on_line(self, coefficients: ArrayLike) -> NDArray[np.float32]:
        """Return the factors of the mean and the modes, shape (1 + K,)."""
        c = self._checked(coefficients)
        return np.concatenate([[1.0, line_tone(c[0])], c[1:]]).astype(np.float32)

    def _logs(self, c: NDArray[np.float32]) -> tuple[Image32, Image32]:
        """Return brightness, (1024, 1024), and chroma, (2, 256, 256), of bare skin from the factors of the modes."""
        luma, chroma = (
            np.tensordot(c[:2], planes[:2], 1) + limit(np.tensordot(c[2:], planes[2:], 1))
            for planes, limit in ((self.luma, limited_brightness), (self.chroma, limited_chroma))
        )
        largest = np.maximum(chroma.max(axis=0), -chroma.sum(axis=0))
        return below_white(luma, _resized(largest, luma.shape[0])), chroma

    def _checked(self, coefficients: ArrayLike) -> Array:
        given = np.asarray(coefficients, dtype=np.float64)
        if given.shape != (self.n_coefficients,) or not np.isfinite(given).all():
            raise FacePoserError(
                f"The skin has {given.size} coefficients instead of {self.n_coefficients} finite ones: it was made "
                "with another version of the model; choose another skin."
            )
        return given

    @cached_property
    def _pores(self) -> Image32:
        """Fine grain of the skin that repeats, added to the brightness, shape (tile, tile)."""
        from scipy import ndimage

        noise = np.random.default_rng(1).standard_normal((2, _TILE, _TILE))
        fine, coarse = (
            ndimage.gaussian_filter(field, width, mode="wrap") for field, width in zip(noise, (0.9, 2.6), strict=True)
        )
        grain = fine / fine.std() + 0.7 * coarse / coarse.std()
        # Pores are pits, so that the dark half is stronger.
        grain = np.where(grain < 0.0, 1.25 * grain, 0.6 * grain)
        return (_PORES * (grain - grain.mean())).astype(np.float32)

    @cached_property
    def _grain(self) -> Image32:
        """Strength of the pores, shape (SIZE, SIZE)."""
        picture = np.asarray(Image.open(io.BytesIO(self.layers["grain"]), formats=["JPEG"]), dtype=np.float32)
        return _resized(picture / np.float32(255.0), SIZE)

    @cached_property
    def _creases(self) -> Image32:
        """Upright creases of the lips that repeat, added to their logarithms, shape (tile, tile)."""
        from scipy import ndimage

        noise = np.random.default_rng(2).standard_normal((_TILE, _TILE))
        streaks = ndimage.gaussian_filter(noise, (14.0, 1.6), mode="wrap")
        return (_CREASES * streaks / streaks.std()).astype(np.float32)

    @cached_property
    def _masks(self) -> Layer:
        planes = [self._decoded(name) for name in ("masks", "inside")]
        return Layer(np.concatenate([np.moveaxis(plane, 2, 0) for plane in planes]), (0, 0, 0, 0, 0, 255))

    def _hairs(self, style: SkinLayers, skin: Array) -> list[tuple[str, Layer, Colour, float]]:
        found = []
        # Brows like the hair would vanish on skin that is as dark.
        red, green, blue = np.minimum(style.hair_colour, _BROWS_BELOW * skin).tolist()
        brows = style.brow_colour or (red, green, blue)
        for name, colour, density in (
            ("beard", style.hair_colour, style.beard),
            (f"hair.{style.hair}", style.hair_colour, 1.0),
            (f"brows.{style.brows}", brows, style.brow_strength),
        ):
            if name in self.layers and density > 0.0:
                found.append((name, self._hair_layer(name), colour, density))
        return found

    def _hair_layer(self, name: str) -> Layer:
        kept = self.__dict__.setdefault("_hair_layers", {})
        if name not in kept:
            plane = self._decoded(name)
            transmission, shade = plane[:SIZE], plane[SIZE:]
            # Faint echoes of hairs that compression leaves in bare skin are taken out.
            bare = transmission > _BARE
            kept[name] = Layer(np.stack([np.where(bare, 255, transmission), np.where(bare, 0, shade)]), (255, 0))
        layer: Layer = kept[name]
        return layer

    def _decoded(self, name: str) -> NDArray[np.uint8]:
        picture = Image.open(io.BytesIO(self.layers[name]))
        scale = SIZE // picture.width
        return np.asarray(picture.resize((SIZE, picture.height * scale), Image.Resampling.BICUBIC))

    @cached_property
    def _coarse(self) -> tuple[Image32, Image32]:
        """Weight of bare skin of the face, shape (H, H), and mean and modes, shape (1 + K, 3, H, H), of the grid."""
        luma = np.stack([_resized(image, _COARSE) for image in self.luma])
        red, blue = self.chroma[:, 0], self.chroma[:, 1]
        basis = np.stack([luma + red, luma - red - blue, luma + blue], axis=1)
        # Textures show the darkened folds, too.
        folds = np.log(np.maximum(_resized(self._masks.planes[5] / np.float32(255.0), _COARSE), 0.02))
        basis[0] += folds * (FOLDS * FOLDS_SHARE)[:, None, None]
        covered = np.zeros((SIZE, SIZE), dtype=np.float32)
        for name in (*(name for name in self.layers if name.startswith(("hair.", "brows."))), "beard"):
            covered = np.maximum(covered, 1.0 - self._hair_layer(name).planes[0] / np.float32(255.0))
        for plane in self._masks.planes[:4]:
            covered = np.maximum(covered, plane / np.float32(255.0))
        bare = 1.0 - _resized(covered, _COARSE)
        rows, columns = np.mgrid[0:_COARSE, 0:_COARSE] / _COARSE
        low, high, left, right = _FACE
        inside = (rows > low) & (rows < high) & (columns > left) & (columns < right)
        return np.where((bare > 0.95) & inside, bare, 0.0).astype(np.float32), basis


@lru_cache(maxsize=1)
def load_texture_model(path: Path | None = None) -> TextureModel:
    """Return the texture model in ``path``, the shipped one if None.

    Raises:
        FacePoserError: If the file cannot be read, or is damaged.
    """
    path = path or asset_path("identity-textures.npz")
    meta, members = read_companion(path, FORMAT, NOUN)
    try:
        lips = members["lips"].astype(np.float64)
        ranges = np.array(meta["ranges"], dtype=np.float64).reshape(len(lips), 3, 2)
        planes = [
            [_stored(members[f"skin.{k}.{name}"], limits) for name, limits in zip(_CHANNELS, row, strict=True)]
            for k, row in enumerate(ranges)
        ]
        layers = {name: members[name].tobytes() for name in members if not name.startswith("skin.") and name != "lips"}
        vectors = [
            {name: np.array(v, dtype=np.float64) for name, v in meta[key].items()} for key in ("labels", "skins")
        ]
        for vector in vectors[1].values():
            vector[:1] = [scale_tone(tone) for tone in vector[:1]]
        for name, data in layers.items():
            _check_picture(data, 1 if name in ("masks", "inside", "grain") else 2)
        if any(vector.shape != (len(lips) - 1,) for group in vectors for vector in group.values()):
            raise ValueError("coefficients")
        if not np.isfinite(ranges).all() or not {"masks", "inside", "grain", "beard"} <= layers.keys():
            raise ValueError("layers")
        luma = np.stack([plane[0] for plane in planes])
        chroma = np.stack([np.stack(plane[1:]) for plane in planes])
        labels, skins = vectors
        return TextureModel(luma, chroma, lips, labels, skins, layers, str(meta["credits"]))
    except _INVALID as error:
        raise unusable(path, NOUN, "its arrays do not belong together") from error


def _check_picture(data: bytes, ratio: int) -> None:
    """Raise ValueError if an image is not a JPEG file of ``ratio`` squares one above the other that divide `SIZE`."""
    with Image.open(io.BytesIO(data), formats=["JPEG"]) as picture:
        width, height = picture.size
        if width > SIZE or SIZE % width or height != ratio * width:
            raise ValueError("size")


def _stored(data: NDArray[Any], limits: Array) -> Image32:
    content = data.astype(np.uint8).tobytes()
    _check_picture(content, 1)
    pixels = np.asarray(Image.open(io.BytesIO(content), formats=["JPEG"]), dtype=np.float32)
    low, high = (np.float32(limit) for limit in limits)
    return low + (high - low) / np.float32(255.0) * pixels


def _resized(image: Image32, size: int) -> Image32:
    method = Image.Resampling.BILINEAR if size > image.shape[0] else Image.Resampling.BOX
    picture = Image.fromarray(np.ascontiguousarray(image, dtype=np.float32)).resize((size, size), method)
    return np.asarray(picture, dtype=np.float32)
