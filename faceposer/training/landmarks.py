"""Regions and feature points of a character with ARKit's shapes, located by their motion.

Position alone does not identify a mouth corner, because faces differ. But a smile moves it most, a pucker moves it
inwards and a blink not at all. Each place of the built-in man is matched to the vertex of the other face with the most
similar position and strengths of all shapes.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.model.character import Part
from faceposer.model.character_file import load_character
from faceposer.training.eyes import side_of

# Distance in centimetres equivalent to a difference of one in the strength of a shape, relative to its maximum.
_STRENGTH_CM = 2.0
# Largest distance of a match, in the same measure.
_TOO_FAR_CM = 4.0
_CHUNK = 1024
_FEWEST_SHAPES = 4
#: Feature points at the front of an eye, by side: the pupils.
_PUPILS = {"Left": "3.5", "Right": "3.6"}

Features = NDArray[np.float32]


@dataclass(frozen=True)
class Landmarks:
    """Regions and feature points of a face.

    Attributes:
        regions: Vertex ids by region.
        feature_points: Vertex id by MPEG-4 feature point.
        feature_titles: Readable name of each feature point.
    """

    regions: Mapping[str, NDArray[np.int32]]
    feature_points: Mapping[str, int]
    feature_titles: Mapping[str, str]


def find_landmarks(
    vertices: NDArray[np.float32], parts: tuple[Part, ...], shapes: Mapping[str, NDArray[np.float32]]
) -> Landmarks:
    """Return the landmarks of a face, matched to the built-in man.

    Args:
        vertices: Upright, in centimetres, shape (N, 3).
        parts: Parts of the mesh.
        shapes: Offsets, (N, 3), by ARKit's names.
    """
    man = load_character("man")
    man_skin = np.arange(*man.part("skin").vertices)
    runs = [np.arange(*part.vertices) for part in parts if part.material == "skin"]
    skin = np.concatenate(runs) if runs else np.zeros(0, dtype=np.intp)
    man_by_name = dict(zip(man.shape_names, man.shapes[:, man_skin], strict=True))
    names = [n for n, shape in man_by_name.items() if n in shapes and np.any(shape) and np.any(shapes[n][skin])]
    if len(names) < _FEWEST_SHAPES or not skin.size:
        return Landmarks({}, {}, {})
    man_shapes = np.stack([man_by_name[name] for name in names])
    new_shapes = np.stack([shapes[name][skin] for name in names])
    man_places = man.vertices[man_skin]
    new_places = _fit_to_man(vertices[skin], new_shapes, man_places, man_shapes)
    man_features = _features(man_places, man_shapes)
    new_features = _features(new_places, new_shapes)

    points, titles = {}, {}
    local = {int(vertex): i for i, vertex in enumerate(man_skin.tolist())}
    on_skin = [name for name, vertex in man.feature_points.items() if vertex in local]
    nearest, distances = _nearest(man_features[[local[man.feature_points[name]] for name in on_skin]], new_features)
    for name, index, distance in zip(on_skin, nearest.tolist(), distances.tolist(), strict=True):
        if distance < _TOO_FAR_CM:
            points[name] = int(skin[index])
            titles[name] = man.feature_titles[name]
    for part in parts:
        if part.material == "eye":
            ball = vertices[slice(*part.vertices)]
            name = _PUPILS[side_of(part, vertices)]
            if name in man.feature_titles and name not in points:
                points[name] = part.vertices[0] + int(np.argmax(ball[:, 2]))
                titles[name] = man.feature_titles[name]

    nearest, distances = _nearest(new_features, man_features)
    close = distances < _TOO_FAR_CM
    regions = {}
    for name, ids in man.regions.items():
        inside = np.zeros(len(man.vertices), dtype=bool)
        inside[ids] = True
        found = skin[close & inside[man_skin[nearest]]]
        if found.size:
            regions[name] = found.astype(np.int32)
    for part in parts:
        if part.material == "eye":
            regions[f"eye_{side_of(part, vertices).lower()}"] = np.arange(*part.vertices, dtype=np.int32)
    return Landmarks(regions, points, titles)


def _fit_to_man(places: Features, shapes: Features, man_places: Features, man_shapes: Features) -> Features:
    """Return ``places`` scaled and shifted along each axis to align the centroids of all shapes' motion."""
    new_middles, man_middles = (
        np.stack([w @ p / w.sum() for w in np.einsum("snd,snd->sn", s, s)])
        for p, s in ((places, shapes), (man_places, man_shapes))
    )
    new_mean, man_mean = new_middles.mean(axis=0), man_middles.mean(axis=0)
    spread = ((new_middles - new_mean) ** 2).sum(axis=0)
    stretch = ((new_middles - new_mean) * (man_middles - man_mean)).sum(axis=0) / np.maximum(spread, 1e-12)
    fitted: Features = (man_mean + (places - new_mean) * np.clip(stretch, 0.6, 1.6)).astype(np.float32)
    return fitted


def _features(places: Features, shapes: Features) -> Features:
    """Return position and strengths of each vertex as one vector, in centimetres, shape (n, 3 + S)."""
    strengths = np.sqrt(np.einsum("snd,snd->sn", shapes, shapes))
    strengths /= strengths.max(axis=1, keepdims=True)
    features: Features = np.hstack([places, _STRENGTH_CM * strengths.T]).astype(np.float32)
    return features


def _nearest(queries: Features, among: Features) -> tuple[NDArray[np.intp], Features]:
    """Return the index of the nearest of ``among`` for each of ``queries``, and the distance."""
    lengths = np.einsum("nd,nd->n", among, among)
    indices, distances = [], []
    for begin in range(0, len(queries), _CHUNK):
        chunk = queries[begin : begin + _CHUNK]
        squares = lengths - 2.0 * (chunk @ among.T)
        best = squares.argmin(axis=1)
        indices.append(best)
        distances.append(np.linalg.norm(chunk - among[best], axis=1))
    return np.concatenate(indices), np.concatenate(distances)
