"""Heads: everything that a character needs, carried from a shipped head to the skin of another one."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from faceposer.errors import FacePoserError
from faceposer.identity.anatomy.cavity import Drawn
from faceposer.identity.anatomy.eyeballs import ball_of
from faceposer.identity.anatomy.eyes import Ball, EyeFit
from faceposer.identity.anatomy.lashes import lash_length, lash_strips
from faceposer.identity.anatomy.local_maps import LocalMaps
from faceposer.identity.anatomy.mouths import MouthFit, Place
from faceposer.identity.template import head_template
from faceposer.model.character import Character
from faceposer.model.character_file import load_character

Floats = NDArray[np.float64]

#: The shipped character that others are made after.
REFERENCE = "man"
#: Least and greatest size of a head relative to the reference.
_SIZES = (0.2, 5.0)
_MOUTH_PARTS = ("teeth_upper", "gums_upper", "teeth_lower", "gums_lower", "throat", "tongue")


@dataclass(frozen=True, eq=False)
class Head:
    """A neutral head with its parts in place.

    Attributes:
        vertices: All vertices in the order of the shipped heads, in centimetres, shape (N, 3).
        maps: Linear maps from the reference to this head at the skin's vertices, shape (n, 3, 3).
        balls: Eyeballs by side.
        mouth: Place of the inside of the mouth.
        lining: Lining of the mouth as it was drawn in to stay inside the skin.
        throat: Throat, likewise.
    """

    vertices: Floats
    maps: Floats
    balls: dict[str, Ball]
    mouth: Place
    lining: Drawn
    throat: Drawn


class HeadMaker:
    """Maker of heads after a reference; it is prepared once.

    Attributes:
        reference: The character whose topology, parts and shapes all heads get.
        n_skin: Number of vertices of the skin, which come first.
        lips: Measures of its mouth.
    """

    def __init__(self, reference: Character) -> None:
        """Measure ``reference``, one of the two shipped human heads."""
        self.reference = reference
        skin = reference.part("skin")
        self.n_skin = skin.vertices[1]
        self._template = template = head_template()
        vertices = reference.vertices.astype(np.float64)
        rest = vertices[: self.n_skin]
        self._rest = rest
        outside = np.unique(np.concatenate([ids for ids in reference.regions.values() if ids.max() < self.n_skin]))
        outside = outside.astype(np.int32)
        self._maps = LocalMaps(rest, outside, template.n_control)
        names = reference.shape_names
        self._eyes: dict[str, EyeFit] = {}
        self._roots: dict[str, NDArray[np.int32]] = {}
        self._lash_lengths: dict[str, float] = {}
        for side in ("Left", "Right"):
            ball = Ball(*ball_of(vertices[self._ids(f"eye_{side.lower()}")]))
            blink = reference.shapes[names.index(f"eyeBlink{side}"), : self.n_skin].astype(np.float64)
            self._eyes[side] = EyeFit(side, template, rest, blink, ball)
            eye, lashes = self._eyes[side], vertices[self._ids(f"lashes_{side.lower()}")]
            self._roots[side] = eye.ring[cKDTree(rest[eye.ring]).query(lashes)[1]]
            self._lash_lengths[side] = lash_length(side, rest, eye.halves, ball.centre, lashes)
        self._open, self._close = names.index("jawOpen"), names.index("mouthClose")
        opening = reference.shapes[self._open, : self.n_skin].astype(np.float64)
        smiles = [names.index(f"mouthSmile{side}") for side in ("Left", "Right")]
        smile = reference.shapes[smiles, : self.n_skin].astype(np.float64).sum(axis=0)
        self.lips = MouthFit(template, rest, outside, opening, smile)
        self._lining = self.lips.cavity.part(rest[self.lips.cavity.ids])
        self._throat = self.lips.cavity.part(vertices[self._ids("throat")])
        self._lining_losses = self.lips.lining.losses(rest, reference.shapes[:, : self.n_skin].astype(np.float64))
        forward = np.linalg.norm(reference.shapes[names.index("jawForward")], axis=1)
        lower = reference.part("teeth_lower").vertices[0]
        self._jaw_share = forward.astype(np.float64) / float(forward[lower])

    @staticmethod
    def shipped() -> "HeadMaker":
        """Return the maker of heads after the shipped man, prepared at the first call."""
        return _shipped()

    def head(self, skin: ArrayLike) -> Head:
        """Return the head with ``skin``: its lips closed, its lids on eyeballs that fit, the mouth's inside in place.

        Args:
            skin: Neutral positions in centimetres, shape (n, 3), y up, the face along +z, x = 0 the plane of symmetry.

        Raises:
            FacePoserError: If the shape is another, a value is not finite, or the size is not that of a head.
        """
        vertices = self.lips.lining.inside(self.lips.close_lips(self._checked(skin)))
        balls = {side: eye.place(vertices) for side, eye in self._eyes.items()}
        for side, eye in self._eyes.items():
            vertices = eye.fit_lids(vertices, balls[side])
        maps = (self._template.fine.split @ self._maps(vertices).reshape(-1, 9)).reshape(-1, 3, 3)
        mouth = self.lips.place(vertices, maps)
        cavity, throat = self.lips.cavity, self._ids("throat")
        middles = self.lips.carry(cavity.middles, replace(mouth, rise=0.0))
        lining = cavity.drawn(self._lining, vertices[cavity.ids], vertices, middles, mouth.scale)
        vertices[cavity.ids] = lining.points
        everything = self.reference.vertices.astype(np.float64)
        everything[: self.n_skin] = vertices
        for side, ball in balls.items():
            ids, rest = self._ids(f"eye_{side.lower()}"), self._eyes[side].ball
            everything[ids] = ball.centre + ball.radius / rest.radius * (everything[ids] - rest.centre)
        for name in _MOUTH_PARTS:
            ids = self._ids(name)
            everything[ids] = self.lips.carry(everything[ids], mouth)
        drawn_throat = cavity.drawn(self._throat, everything[throat], vertices, middles, mouth.scale)
        everything[throat] = drawn_throat.points
        return Head(everything, maps, balls, mouth, lining, drawn_throat)

    def shapes(self, head: Head) -> Floats:
        """Return the offsets of the reference's shapes on ``head``, whose lashes get their places, shape (S, N, 3)."""
        names, given = self.reference.shape_names, self.reference.shapes
        result = given.astype(np.float64)
        skin, n = head.vertices[: self.n_skin], self.n_skin
        carried = np.matmul(result[:, :n].transpose(1, 0, 2), head.maps.transpose(0, 2, 1)).transpose(1, 0, 2)
        opening = self.lips.opening(skin, head.maps, head.mouth)
        carried[self._close] += self.lips.closing[:, None] * (carried[self._open] - opening)
        carried[self._open] = opening
        carried[:, self.lips.cavity.ids] = head.lining.following(carried[:, self.lips.cavity.ids], carried)
        carried = self.lips.lining.losing_less(skin, carried, head.mouth.scale * self._lining_losses)
        carried[self._close] = self.lips.lining.behind(skin, carried[self._open], carried[self._close])
        for side, eye in self._eyes.items():
            carried = eye.fit_shapes(skin, carried, names, head.balls[side])
        result[:, :n] = carried
        for side, ball in head.balls.items():
            result[:, self._ids(f"eye_{side.lower()}")] *= ball.radius / self._eyes[side].ball.radius
        for name in _MOUTH_PARTS:
            ids = self._ids(name)
            result[:, ids] *= head.mouth.scale
            of_reference = given[self._open, ids].astype(np.float64)
            points = self.reference.vertices[ids].astype(np.float64)
            result[self._open, ids] = self.lips.carry_opening(points, of_reference, self._jaw_share[ids], head.mouth)
        throat = self._ids("throat")
        result[:, throat] = head.throat.following(result[:, throat], carried)
        for side, eye in self._eyes.items():
            ball = head.balls[side]
            length = self._lash_lengths[side] * ball.radius / eye.ball.radius
            strips = lash_strips(side, skin, carried, eye.halves, eye.lid, ball.centre, length)
            ids = self._ids(f"lashes_{side.lower()}")
            head.vertices[ids] = np.concatenate([strip.reshape(-1, 3) for strip, _ in strips])
            result[:, ids] = np.concatenate([offsets.reshape(len(names), -1, 3) for _, offsets in strips], axis=1)
        return result

    def _ids(self, name: str) -> slice:
        return slice(*self.reference.part(name).vertices)

    def _checked(self, skin: ArrayLike) -> Floats:
        vertices = np.array(skin, dtype=np.float64)
        if vertices.shape != self._rest.shape:
            raise FacePoserError(f"The skin of a head must have shape {self._rest.shape}, not {vertices.shape}.")
        if not np.isfinite(vertices).all():
            raise FacePoserError("The skin of the head has coordinates that are not finite numbers.")
        size = float(np.sqrt(vertices.var(axis=0).sum() / self._rest.var(axis=0).sum()))
        if not _SIZES[0] < size < _SIZES[1]:
            raise FacePoserError(
                f"The skin of the head is {size:.3g} times as large as that of the character '{REFERENCE}'; give it in "
                "centimetres."
            )
        return vertices


@lru_cache(maxsize=1)
def _shipped() -> HeadMaker:
    return HeadMaker(load_character(REFERENCE))
