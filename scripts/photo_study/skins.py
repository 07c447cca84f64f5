"""Errors of the skins of heads from synthetic photos, of people whose skins are known."""

import io
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from faceposer.identity.photos.face_texels import SIDE, Texels, face_texels
from faceposer.identity.photos.head_from_photos import head_from_photos
from faceposer.identity.photos.landmark_fit import PhotoFace
from faceposer.identity.skin_layers import BROW_STYLES, HAIR_STYLES
from faceposer.identity.texture_model import load_texture_model
from faceposer.landmarks.drawing import visible_triangles
from faceposer.landmarks.points import find_landmarks
from scripts.photo_study.study import FIRST_SEED, YAWS, Study
from scripts.photo_study.synthetic import SIZE, photo_of, random_person, random_weights

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Share of a texel that layers leave bare, and least share of the face that a texel of the face has.
_BARE, _FACE = 0.97, 0.5
_DARKEST = 5.0


@dataclass(frozen=True)
class SkinError:
    """Errors of a skin.

    Attributes:
        face: Mean difference of the colours of the bare skin of the face, of 255.
        elsewhere: That of the rest of the bare skin.
        face_shades: Mean difference of the logarithms on the face after the median difference, as the tone of skin and
            the strength of the light cannot be told apart.
        elsewhere_shades: That of the rest, after the same median.
    """

    face: float
    elsewhere: float
    face_shades: float
    elsewhere_shades: float


class SkinStudy:
    """Errors of skins from one photo of each person."""

    def __init__(self, study: Study) -> None:
        """Prepare the parts of the skin without hair, lips and lashes."""
        self._study = study
        model, basis = load_texture_model(), study.basis
        names = [f"hair.{style}" for style in HAIR_STYLES] + [f"brows.{style}" for style in BROW_STYLES] + ["beard"]
        bare = np.min([model.layer(name, SIDE)[0] for name in names if name in model.layers], axis=0)
        triangles, character = basis.editor.template.triangles, basis.character
        pixels = np.stack([character.uv[:, 0], 1.0 - character.uv[:, 1]], axis=1).astype(np.float64) * SIDE
        faces, _ = visible_triangles(
            pixels, np.ones(len(pixels)), character.triangle_uvs[: len(triangles)], (SIDE, SIDE)
        )
        covered = np.maximum(model.mask("lips", SIDE), model.mask("lashes", SIDE))
        skin = (faces.reshape(SIDE, SIDE) >= 0) & (bare > _BARE) & (covered < 1.0 - _BARE)
        texels: Texels = face_texels(basis, study.places)
        face = np.zeros(SIDE * SIDE, dtype=bool)
        face[texels.at[texels.region > _FACE]] = True
        self._face: Mask = skin & face.reshape(SIDE, SIDE)
        self._elsewhere: Mask = skin & ~face.reshape(SIDE, SIDE)

    def errors(self, number: int) -> Iterator[SkinError]:
        """Yield the error of the skin of person ``number``, nothing if no face is found in the photo."""
        study = self._study
        rng = np.random.default_rng(1000 + number)
        person = random_person(study.basis.editor, study.basis.character, FIRST_SEED + number)
        many = np.random.default_rng(number) if study.other_lights else None
        yaw, weights = float(rng.uniform(*YAWS[0])), random_weights(study.basis.model, rng)
        photo = photo_of(person, study.basis.character, weights, rng, yaw, many=many)
        found = find_landmarks(photo.pixels)
        if found is None:
            return
        face = PhotoFace(found, (SIZE, SIZE), 2.0 * SIZE, 0.3)
        head = head_from_photos([face], [photo.pixels], [str(number)], name="person", title="Person")
        yield self.error(_decoded(head.character.textures["skin"]), _decoded(person.textures["skin"]))

    def error(self, texture: Array, truth: Array) -> SkinError:
        """Return the error of a ``texture``, 0 to 255, against the ``truth``, shape (side, side, 3) each."""
        parts = (self._face, self._elsewhere)
        face, elsewhere = (float(np.abs(texture - truth)[part].mean()) for part in parts)
        logs = np.log(np.maximum(texture, _DARKEST)) - np.log(np.maximum(truth, _DARKEST))
        logs -= np.median(logs[self._face], axis=0)
        shades = [float(np.abs(logs)[part].mean()) for part in parts]
        return SkinError(face, elsewhere, *shades)


def _decoded(encoded: bytes) -> Array:
    picture = Image.open(io.BytesIO(encoded)).convert("RGB").resize((SIDE, SIDE), Image.Resampling.BOX)
    return np.asarray(picture, dtype=np.float64)
