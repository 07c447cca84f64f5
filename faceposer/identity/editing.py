"""Editing of the head of a character: identities to characters, and changes of identities."""

import dataclasses
import io
from collections.abc import Collection, Mapping
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from faceposer.errors import FacePoserError
from faceposer.geometry.alignment import rigid_alignment
from faceposer.geometry.picking import SurfacePoints
from faceposer.identity.attributes import PERSON, load_attributes
from faceposer.identity.eye_colour import eye_texture, random_eye_colour
from faceposer.identity.head import HeadMaker
from faceposer.identity.identity import MOST, Identity, SkinTexture, is_editable
from faceposer.identity.model import IdentityModel
from faceposer.identity.model_file import load_identity_model
from faceposer.identity.segments import Segments
from faceposer.identity.skin_following import NATURAL_LABELS, following_skin
from faceposer.identity.skin_layers import SkinLayers, random_layers
from faceposer.identity.skin_reading import layers_of
from faceposer.identity.template import HeadTemplate
from faceposer.identity.texture_model import LIMIT, load_texture_model
from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel

Array = NDArray[np.float64]

# Largest and least standard deviation in centimetres of what a character's own head has outside the statistics, per
# coordinate, number of vertices in which that counts as independent, and rounds in which it is estimated.
_NOISE, _LEAST_NOISE, _INDEPENDENT, _ROUNDS = 0.3, 0.005, 200, 5


class HeadEditor:
    """The head of one character in terms of the morphable model, and characters with other heads.

    Attributes:
        character: The character, whose own head is ``own``.
        model: The morphable model.
        attributes: Measurements of heads.
        own: Identity of the character's head.
    """

    def __init__(self, character: Character) -> None:
        """Measure the head of ``character``.

        Raises:
            FacePoserError: If it does not have the topology of the model, or an asset is damaged.
        """
        self.model = load_identity_model()
        self.attributes = load_attributes()
        if not is_editable(character):
            raise FacePoserError(
                f"The head of '{character.title}' cannot be edited, since its mesh is not that of the built-in man; "
                "open the man, the woman or a character made from them."
            )
        self.character = character
        template = self.template
        skin = character.vertices[: template.n_skin].astype(np.float64)
        c = template.n_control
        weights = self.attributes.alignment_weights
        self._alignment = rigid_alignment(skin[:c], template.skin(self.model.mean_vertices)[:c], weights)
        aligned = self._alignment.apply(skin)
        control = template.control(aligned)
        # What a subdivided mesh cannot have, as at the edges of the lids.
        self._fine = aligned - template.skin(control)
        rows = np.tile(_coefficients(self.model, control, weights), (len(self.segments.names), 1))
        self.own = Identity.of(rows, control - self.model.vertices(rows))

    @property
    def template(self) -> HeadTemplate:
        """The topology of the model."""
        assert self.model.template is not None
        return self.model.template

    @property
    def segments(self) -> Segments:
        """The segments of the model."""
        assert self.model.segments is not None
        return self.model.segments

    @property
    def segment_names(self) -> tuple[str, ...]:
        """Names of the segments, in the order of the rows of ``Identity.shape``."""
        return self.segments.names

    @cached_property
    def maker(self) -> HeadMaker:
        """Maker of characters after this one."""
        return HeadMaker(self.character)

    @cached_property
    def symmetric_modes(self) -> NDArray[np.bool_]:
        """Mask of the modes that are their own mirror images, shape (K,); the others are their negative ones."""
        basis = self.model.basis
        mirrored = np.stack([self.template.mirrored(mode) for mode in basis])
        even: NDArray[np.bool_] = np.einsum("kcd,kcd->k", basis, mirrored) > 0.0
        return even

    @property
    def average(self) -> Identity:
        """The average head of the model."""
        return Identity.of(np.zeros_like(self.own.shape))

    def aligned_skin(self, identity: Identity) -> Array:
        """Return the skin of ``identity`` in the frame of the model, shape (N, 3).

        Raises:
            FacePoserError: If it does not have the numbers of this model.
        """
        result: Array = self.template.skin(self.control(identity)) + self._fine
        return result

    def control(self, identity: Identity) -> Array:
        """Return the control vertices of ``identity`` in the frame of the model, shape (C, 3).

        Raises:
            FacePoserError: As ``aligned_skin``.
        """
        self._check(identity)
        control = self.model.vertices(identity.shape)
        return control + identity.detail if len(identity.detail_steps) else control

    def control_weights(self, points: SurfacePoints) -> Array:
        """Return the weights of control vertices whose sum is each of ``points`` on the skin, shape (n, C).

        Raises:
            ValueError: If a point is not on the skin.
        """
        if not self.on_skin(points):
            raise ValueError("a point is not on the skin")
        corners = points.corners(self.character.triangles)
        rows = self.template.matrix[corners.ravel()].toarray().reshape(*corners.shape, -1)
        weights: Array = np.einsum("nk,nkc->nc", points.barycentric, rows)
        return weights

    def on_skin(self, points: SurfacePoints) -> bool:
        """Return True if all ``points`` are on the skin, not on eyes, teeth or lashes."""
        return bool(np.all(points.corners(self.character.triangles) < self.template.n_skin))

    @property
    def rotation(self) -> Array:
        """Rotation of the model's frame to the character's, shape (3, 3)."""
        return self._alignment.rotation.T

    def skin(self, identity: Identity) -> Array:
        """Return the skin of ``identity`` in the frame of the character, shape (N, 3)."""
        return self._alignment.inverse().apply(self.aligned_skin(identity))

    def with_head(self, identity: Identity) -> Character:
        """Return the character with the head ``identity``: all its parts and shapes follow."""
        if identity.same(self.own):
            return self.character
        head = self.maker.head(self.skin(identity))
        shapes = self.maker.shapes(head)
        textures = self.character.textures
        if identity.texture is not None:
            textures = {**textures, **textures_of(identity.texture)}
        return dataclasses.replace(
            self.character,
            vertices=head.vertices.astype(np.float32),
            shapes=shapes.astype(np.float32),
            textures=textures,
        )

    def preview(
        self, model: FaceModel, pose: ArrayLike, identity: Identity, contact: bool = False
    ) -> NDArray[np.float32]:
        """Return approximate vertices of ``identity`` in a pose, shape (N, 3), quick enough for each frame of a drag.

        The displacements of the pose are those of the present head.

        Args:
            model: Face model of the present head of this character.
            pose: Its coefficients, shape (r,).
            identity: The head to show.
            contact: Apply the contact step of the present head.
        """
        head = self.maker.head(self.skin(identity)).vertices
        moved = head - model.character.vertices
        lashes, lids = self._lashes
        moved[lashes] = moved[lids]
        result: NDArray[np.float32] = (model.surface(pose, contact) + moved).astype(np.float32)
        return result

    @cached_property
    def _lashes(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Vertices of lashes, which ``HeadMaker.head`` does not place, and of the skin nearest to them."""
        from scipy.spatial import KDTree

        parts = [part for part in self.character.parts if part.material == "lashes"]
        lashes = np.concatenate([np.arange(*part.vertices) for part in parts])
        vertices = self.character.vertices
        return lashes, KDTree(vertices[: self.template.n_skin]).query(vertices[lashes])[1]

    # Changes of identities

    def measure(self, identity: Identity) -> dict[str, float]:
        """Return the value of each attribute."""
        return self.attributes.measure(self.aligned_skin(identity))

    def with_attributes(
        self,
        identity: Identity,
        values: Mapping[str, float],
        keep: Collection[str] | None = None,
        seed: int = 0,
        skin_follows: bool = True,
    ) -> Identity:
        """Return the head that measures ``values``.

        Args:
            identity: A head.
            values: Values by name of attribute.
            keep: Attributes that keep their values besides. If None, attributes of the face keep all others; those of
                the person, such as age, keep each other and change the face as people of that kind differ.
            seed: As for ``HeadAttributes.changed``.
            skin_follows: Take a skin of the texture model along with age and gender.

        Raises:
            FacePoserError: As for ``HeadAttributes.changed``.
        """
        if keep is None and all(self.attributes[name].group != PERSON for name in values):
            keep = self.attributes.names
        skin = self.aligned_skin(identity)
        changed = self.attributes.changed(skin, values, keep, seed)
        result = self._moved(identity, self.template.control(changed - skin))
        if result.texture is None or not skin_follows or not NATURAL_LABELS.keys() & values.keys():
            return result
        before = self.attributes.measure(skin)
        return dataclasses.replace(result, texture=following_skin(result.texture, before, {**before, **values}))

    def _moved(self, identity: Identity, offsets: Array) -> Identity:
        """Return the head with control vertices moved by ``offsets``, (C, 3), by the modes as far as they span them."""
        along = self.model.project(self.model.mean_vertices + offsets, noise=self._moving_noise).coefficients
        shape = identity.shape + along
        detail = identity.detail if len(identity.detail_steps) else np.zeros_like(offsets)
        left = offsets - np.tensordot(along, self.model.basis, 1)
        return Identity.of(shape, detail + left, identity.texture)

    @property
    def _moving_noise(self) -> float:
        return _NOISE * float(np.sqrt(self.template.n_control / _INDEPENDENT))

    def random(
        self, seed: int, present: Identity | None = None, free: Collection[str] | None = None, spread: float = 1.0
    ) -> Identity:
        """Return a random head, reproducible by ``seed``.

        Args:
            seed: Seed.
            present: The head whose segments that are not free remain; the average if None.
            free: Names of the segments that change; all if None.
            spread: Standard deviations relative to those of people.
        """
        drawn = spread * self.model.sample(seed)[0]
        if free is None:
            texture = None if present is None else present.texture
            return Identity.of(np.tile(drawn, (len(self.segment_names), 1)), texture=texture)
        kept = self.average if present is None else present
        changes = np.array([name in free for name in self.segment_names])
        shape = np.where(changes[:, None], drawn, kept.shape)
        held = self.segments.weights[~changes].sum(axis=0)[:, None]
        detail = held * kept.detail if len(kept.detail_steps) else None
        return Identity.of(shape, detail, kept.texture)

    def own_texture(self) -> SkinTexture:
        """Return the texture of the model that is most like the character's own, and its layers.

        Raises:
            FacePoserError: If the character's image cannot be read.
        """
        model = load_texture_model()
        data = self.character.textures.get("skin")
        if reason := self.character.damaged_textures.get("skin"):
            raise FacePoserError(
                f"The image of the skin of '{self.character.title}' cannot be read: {reason}; choose another skin."
            )
        if data is None:
            return SkinTexture((0.0,) * model.n_coefficients)
        picture = np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))
        found = np.clip(model.project(picture), -LIMIT, LIMIT)
        for name, limits in NATURAL_LABELS.items():
            # Painted skins are outside what the model has seen.
            found = model.with_label(found, name, float(np.clip(model.label(found, name), *limits)))
        return SkinTexture(tuple(found.tolist()), layers_of(model, found, picture, self._usual_layers(self.own)))

    def random_texture(self, seed: int, identity: Identity) -> SkinTexture:
        """Return a random skin that fits the age and gender of ``identity``, reproducible by ``seed``."""
        model = load_texture_model()
        drawn = model.sample(seed)[0]
        values = self.measure(identity)
        age, gender = (float(np.clip(values[name], *NATURAL_LABELS[name])) for name in ("age", "gender"))
        for name, value in (("age", age), ("gender", gender)):
            drawn = model.with_label(drawn, name, value)
        tone = model.tone(drawn)
        layers = random_layers(seed, tone, gender, age)
        return SkinTexture(tuple(drawn.tolist()), layers, random_eye_colour(seed, tone))

    def _usual_layers(self, identity: Identity) -> SkinLayers:
        """Return layers that fit the gender of ``identity``, as measured."""
        female = self.measure(identity)["gender"] > 0.0
        return SkinLayers(hair="combed" if female else "short", brows="arched" if female else "straight")

    def distance(self, identity: Identity) -> float:
        """Return how far a head is from the average: 0 for the average itself, about 1 for people.

        It is the Mahalanobis distance ‖b‖, divided by the square root of the number of modes, of the segments' mean;
        what lies outside the modes does not count.
        """
        return float(np.sqrt(np.square(identity.shape).mean()))

    def _check(self, identity: Identity) -> None:
        expected, n = self.own.shape.shape, self.template.n_control
        if identity.shape.shape != expected or len(identity.detail_steps) not in (0, n):
            raise FacePoserError(
                f"The identity has coefficients of shape {identity.shape.shape} and {len(identity.detail_steps)} "
                f"places of detail instead of {expected} and {n}: it was made with another version of the model; "
                "restore the head of the character's file, and change it again."
            )
        if not np.abs(identity.shape).max() <= MOST:
            raise FacePoserError(
                f"The head would be more than {MOST:g} standard deviations from the average; exaggerate it less."
            )


def _coefficients(model: IdentityModel, control: Array, weights: Array) -> Array:
    """Return the coefficients of a head, shape (K,), with the noise that its own residual suggests.

    Heads made by the model so get back the coefficients that they were made from, and those of other sources no more
    than the statistics explain.
    """
    noise = _NOISE
    for _ in range(_ROUNDS):
        found = model.project(control, weights, noise * float(np.sqrt(weights.sum() / _INDEPENDENT)))
        noise = min(max(found.residual / np.sqrt(3.0), _LEAST_NOISE), _NOISE)
    return found.coefficients


@lru_cache(maxsize=4)
def _encoded_skin(coefficients: tuple[float, ...], layers: SkinLayers) -> bytes:
    return load_texture_model().encoded(coefficients, layers)


def textures_of(texture: SkinTexture) -> dict[str, bytes]:
    """Return the encoded images of ``texture`` by material: "skin", and "eye" if the irises have a colour."""
    images = {"skin": _encoded_skin(texture.coefficients, texture.layers)}
    if texture.eyes is not None:
        images["eye"] = eye_texture(texture.eyes)
    return images


@lru_cache(maxsize=2)
def head_editor(character: Character) -> HeadEditor:
    """Return the editor of ``character``'s head, prepared at the first call.

    Raises:
        FacePoserError: If its head cannot be edited.
    """
    return HeadEditor(character)


def edited_character(character: Character, identity: Identity) -> Character:
    """Return ``character`` with the head ``identity``.

    Raises:
        FacePoserError: If its head cannot be edited, or the identity is not one of this model.
    """
    return head_editor(character).with_head(identity)
