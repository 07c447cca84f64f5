"""Other versions of a character, as a new release or another import makes them."""

from dataclasses import replace

import numpy as np

from faceposer.model.character import Character


def renumbered(character: Character, scale: float = 1.0, shift: float = 0.0, seed: int = 3) -> Character:
    """Return ``character`` with vertices and polygons of each part in another order, scaled and then moved."""
    rng = np.random.default_rng(seed)
    vertices = np.arange(len(character.vertices))
    polygons = np.arange(len(character.polygons))
    for part in character.parts:
        vertices[slice(*part.vertices)] = rng.permutation(vertices[slice(*part.vertices)])
        polygons[slice(*part.polygons)] = rng.permutation(polygons[slice(*part.polygons)])
    new = np.empty_like(vertices)
    new[vertices] = np.arange(len(vertices))
    corners = character.polygons[polygons]
    return replace(
        character,
        vertices=(character.vertices[vertices] * scale + np.float32(shift)).astype(np.float32),
        polygons=np.where(corners >= 0, new[corners], -1).astype(np.int32),
        polygon_uvs=character.polygon_uvs[polygons],
        shapes=character.shapes[:, vertices] * np.float32(scale),
        regions={name: np.sort(new[ids]).astype(np.int32) for name, ids in character.regions.items()},
        feature_points={name: int(new[vertex]) for name, vertex in character.feature_points.items()},
    )
