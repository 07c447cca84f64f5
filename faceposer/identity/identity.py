"""The identity of a head: its coefficients in the morphable model and what they leave, with their form in files."""

import base64
import binascii
import zlib
from dataclasses import asdict, dataclass, field
from typing import Annotated, Any

import numpy as np
from msgspec import UNSET, Meta, UnsetType
from msgspec import field as json_field
from numpy.typing import ArrayLike, NDArray

from faceposer.errors import FacePoserError
from faceposer.files.json_documents import JsonError, JsonObject
from faceposer.identity.skin_layers import Colour, SkinLayers
from faceposer.identity.template import head_template
from faceposer.model.character import Character

Array = NDArray[np.float64]

#: ``Character.structure`` of the built-in man and of all characters whose heads the morphable model describes.
HEAD_STRUCTURE = "16339b4a9ada2099c6273b55e4cb8eff"
#: Largest coefficient in standard deviations in a file; nothing of the kind looks like a head.
MOST = 100.0
#: Factor on the deviation from the average at which a caricature becomes grotesque.
GROTESQUE = 2.5
#: Step of the detail in centimetres: 16 bits reach 6.5 cm in steps of 2 micrometres.
STEP = 2e-4
_LARGEST = 32767
_MAX_VERTICES, _MAX_ENCODED = 100_000, 1 << 20
_Coefficient = Annotated[float, Meta(ge=-MOST, le=MOST)]
_Share = Annotated[float, Meta(ge=0.0, le=1.0)]
_Colour = tuple[_Share, _Share, _Share]
_Row = Annotated[list[_Coefficient], Meta(max_length=1000)]


@dataclass(frozen=True)
class SkinTexture:
    """The texture of a skin in the texture model.

    Attributes:
        coefficients: c in standard deviations, as a tuple of numbers.
        layers: Hair, brows, stubble and lips.
        eyes: Colour of the irises, sRGB, 0 to 1; None for the character's own eyes.
    """

    coefficients: tuple[float, ...]
    layers: SkinLayers = field(default_factory=SkinLayers)
    eyes: Colour | None = None


@dataclass(frozen=True, eq=False)
class Identity:
    """A head relative to the average one: x = S̄ + Σ_s w_s B b_s + d on the control mesh, and its texture.

    Identities form a vector space: sums, multiples and mixtures are heads (Blanz and Vetter 1999, eq. (1)).

    Attributes:
        shape: b_s, coefficients in standard deviations, one row per segment, shape (s, K). Equal rows are one whole
            face.
        detail_steps: d outside the span of the model, in steps of ``STEP`` centimetres, shape (C, 3); empty for none.
        texture: Texture of the skin; None for the character's own.
    """

    shape: Array
    detail_steps: NDArray[np.int16] = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int16))
    texture: SkinTexture | None = None

    def __post_init__(self) -> None:
        if self.shape.ndim != 2 or self.detail_steps.shape[1:] != (3,):
            raise ValueError("the shape has a row per segment, the detail three columns")
        for values in (self.shape, self.detail_steps):
            values.setflags(write=False)

    @classmethod
    def of(cls, shape: ArrayLike, detail: ArrayLike | None = None, texture: SkinTexture | None = None) -> "Identity":
        """Return the identity with ``detail`` in centimetres, shape (C, 3), rounded to steps and clipped to 16 bits."""
        steps = np.zeros((0, 3), dtype=np.int16)
        if detail is not None:
            rounded = np.rint(np.asarray(detail, dtype=np.float64) / STEP).clip(-_LARGEST, _LARGEST)
            steps = rounded.astype(np.int16) if rounded.any() else steps
        return cls(np.array(shape, dtype=np.float64), steps, texture)

    @property
    def detail(self) -> Array:
        """D in centimetres, shape (C, 3) or (0, 3)."""
        return self.detail_steps.astype(np.float64) * STEP

    def same(self, other: "Identity | None") -> bool:
        """Return True if ``other`` is the same head."""
        return self is other or (
            other is not None
            and np.array_equal(self.shape, other.shape)
            and self.texture == other.texture
            and np.array_equal(self.detail_steps, other.detail_steps)
        )

    def scaled(self, factor: float) -> "Identity":
        """Return the head with ``factor`` times the deviation from the average: a caricature beyond 1.

        Of the detail, a caricature exaggerates only what is smooth: wrinkles and edges would fold over.
        """
        detail = min(factor, 1.0) * self.detail
        template = head_template()
        if factor > 1.0 and len(detail) == template.n_control:
            detail += (factor - 1.0) * template.smoothed(detail)
        return Identity.of(factor * self.shape, detail, self.texture)

    def mixed(self, other: "Identity", share: float) -> "Identity":
        """Return the head on the line from this one, at ``share`` 0, to ``other``, at 1."""
        longer = self.detail if len(self.detail_steps) else other.detail
        mine, theirs = (one.detail if len(one.detail_steps) else np.zeros_like(longer) for one in (self, other))
        texture = _texture_between(self.texture, other.texture, share)
        return Identity.of(_between(self.shape, other.shape, share), _between(mine, theirs, share), texture)

    def to_json(self) -> dict[str, Any]:
        """Return the identity as written in a file."""
        data: dict[str, Any] = {"shape": self.shape.tolist()}
        if len(self.detail_steps):
            packed = zlib.compress(self.detail_steps.astype("<i2").tobytes(), 9)
            data["detail"] = base64.b64encode(packed).decode("ascii")
        if self.texture is not None:
            layers = {name: value for name, value in asdict(self.texture.layers).items() if value is not None}
            data["texture"] = {"coefficients": list(self.texture.coefficients), "layers": layers}
            if self.texture.eyes is not None:
                data["texture"]["eyes"] = list(self.texture.eyes)
        return data


def _between(one: Array, other: Array, share: float) -> Array:
    result: Array = one + share * (other - one)
    return result


def _texture_between(one: SkinTexture | None, other: SkinTexture | None, share: float) -> SkinTexture | None:
    """Return the texture at ``share`` from ``one`` to ``other``; layers, and textures of characters, change halfway."""
    nearer = one if share < 0.5 else other
    if one is None or other is None or nearer is None:
        return nearer
    mixed = _between(np.array(one.coefficients), np.array(other.coefficients), share)
    return SkinTexture(tuple(mixed.tolist()), nearer.layers, nearer.eyes)


def is_editable(character: Character) -> bool:
    """Return True if ``character`` has the structure of the built-in man, so that its head can change."""
    return character.structure == HEAD_STRUCTURE


class _LayersJson(JsonObject):
    """Layers over the skin; ``faceposer.identity.texture_model.SkinLayers`` describes the values."""

    hair: str | UnsetType = UNSET
    hair_colour: _Colour | UnsetType = UNSET
    brows: str | UnsetType = UNSET
    brow_colour: _Colour | UnsetType = UNSET
    brow_strength: _Share | UnsetType = UNSET
    beard: _Share | UnsetType = UNSET
    lip_redness: _Share | UnsetType = UNSET
    lash_line: _Share | UnsetType = UNSET

    def layers(self) -> SkinLayers:
        """Return the layers.

        Raises:
            FacePoserError: If a style is unknown.
        """
        given = {name: getattr(self, name) for name in self.__struct_fields__}
        return SkinLayers(**{name: value for name, value in given.items() if value is not UNSET})


class _TextureJson(JsonObject):
    """The texture of a skin in a file."""

    coefficients: _Row
    layers: _LayersJson = json_field(default_factory=_LayersJson)
    eyes: _Colour | UnsetType = UNSET

    def __post_init__(self) -> None:
        try:
            self.layers.layers()
        except FacePoserError as error:
            raise JsonError(f"is not usable ({error})", "layers") from error

    def texture(self) -> SkinTexture:
        """Return the texture."""
        eyes = None if self.eyes is UNSET else self.eyes
        return SkinTexture(tuple(self.coefficients), self.layers.layers(), eyes)


class IdentityJson(JsonObject):
    """An identity in a file: coefficients in standard deviations; the detail as compressed 16-bit steps in base 64."""

    shape: Annotated[list[_Row], Meta(min_length=1, max_length=64)]
    detail: Annotated[str, Meta(max_length=_MAX_ENCODED)] = ""
    texture: _TextureJson | UnsetType = UNSET

    def __post_init__(self) -> None:
        if len({len(row) for row in self.shape}) > 1:
            raise JsonError("must have the same number of coefficients in each row", "shape")
        try:
            _unpacked(self.detail)
        except ValueError as error:
            raise JsonError(f"is damaged ({error}); remove it to leave the detail out", "detail") from error

    def identity(self) -> Identity:
        """Return the identity."""
        texture = None if self.texture is UNSET else self.texture.texture()
        return Identity(np.array(self.shape), _unpacked(self.detail), texture)


def _unpacked(text: str) -> NDArray[np.int16]:
    """Return the detail in ``text``, shape (C, 3).

    Raises:
        ValueError: If it is not base 64 of compressed triples of 16-bit numbers.
    """
    if not text:
        return np.zeros((0, 3), dtype=np.int16)
    most = 6 * _MAX_VERTICES
    try:
        unpacker = zlib.decompressobj()
        data = unpacker.decompress(base64.b64decode(text, validate=True), most + 1)
    except (binascii.Error, zlib.error) as error:
        raise ValueError("it cannot be unpacked") from error
    if not unpacker.eof or len(data) > most:
        raise ValueError("it is cut or too long")
    if len(data) % 6:
        raise ValueError("its numbers do not come in triples")
    return np.frombuffer(data, dtype="<i2").astype(np.int16).reshape(-1, 3)
