"""Characters of any head."""

import dataclasses
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from faceposer.identity.head import HeadMaker
from faceposer.model.character import Character


def character_of(
    skin: ArrayLike, *, name: str, title: str, textures: Mapping[str, bytes] | None = None, credits: str = ""
) -> Character:
    """Return the character of the head with ``skin``: shapes, eyes, mouth, lashes, regions and feature points.

    Args:
        skin: Neutral positions on the shipped heads' topology in centimetres, shape (17259, 3): lips closed, eyes open,
            y up, the face along +z, x = 0 the plane of symmetry.
        name: Short name for commands and files.
        title: Display name.
        textures: Encoded images by material or part, instead of those of the man.
        credits: Source of the skin and its licence, put in front of those of the parts and shapes.

    Raises:
        FacePoserError: If the skin has another shape, is not finite, or is not of the size of a head.
    """
    maker = HeadMaker.shipped()
    reference = maker.reference
    head = maker.head(skin)
    shapes = maker.shapes(head)
    return dataclasses.replace(
        reference,
        name=name,
        title=title,
        vertices=head.vertices.astype(np.float32),
        shapes=shapes.astype(np.float32),
        textures={**reference.textures, **(textures or {})},
        credits=" ".join(text for text in (credits, reference.credits) if text),
    )
