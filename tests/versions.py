"""Other versions of a character, as a new release or another import makes them."""

from dataclasses import replace

import numpy as np

from faceposer.model.subject import Subject


def renumbered(subject: Subject, scale: float = 1.0, shift: float = 0.0, seed: int = 3) -> Subject:
    """Return ``subject`` with vertices and polygons of each part in another order, scaled and then moved."""
    rng = np.random.default_rng(seed)
    vertices = np.arange(len(subject.vertices))
    polygons = np.arange(len(subject.polygons))
    for part in subject.parts:
        vertices[slice(*part.vertices)] = rng.permutation(vertices[slice(*part.vertices)])
        polygons[slice(*part.polygons)] = rng.permutation(polygons[slice(*part.polygons)])
    new = np.empty_like(vertices)
    new[vertices] = np.arange(len(vertices))
    corners = subject.polygons[polygons]
    return replace(
        subject,
        vertices=(subject.vertices[vertices] * scale + np.float32(shift)).astype(np.float32),
        polygons=np.where(corners >= 0, new[corners], -1).astype(np.int32),
        polygon_uvs=subject.polygon_uvs[polygons],
        shapes=subject.shapes[:, vertices] * np.float32(scale),
        regions={name: np.sort(new[ids]).astype(np.int32) for name, ids in subject.regions.items()},
        feature_points={name: int(new[vertex]) for name, vertex in subject.feature_points.items()},
    )
