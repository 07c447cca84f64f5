"""Rigs for tests, made of the shipped ones."""

from dataclasses import replace

import numpy as np

from faceposer.model.character import ARKIT_SHAPES, Character
from faceposer.model.shape_names import weight_map


def with_wholes(character: Character) -> Character:
    """Return ``character`` with exactly ARKit's 52 shapes: wholes in the place of halves."""
    lift = weight_map(character.shape_names, ARKIT_SHAPES).astype(np.float32)
    shapes = np.tensordot(lift.T, character.shapes, axes=1)
    return replace(character, shape_names=ARKIT_SHAPES, shapes=shapes, shape_limits=np.zeros((0, 2), dtype=np.float32))


def with_fewer_shapes(character: Character, count: int = 30) -> Character:
    """Return ``character``, called "me", with its first ``count`` shapes and without textures."""
    return replace(
        character,
        name="me",
        title="Me",
        shape_names=character.shape_names[:count],
        shapes=character.shapes[:count],
        shape_limits=character.shape_limits[:count],
        textures={},
    )
