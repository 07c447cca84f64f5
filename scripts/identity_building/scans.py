"""The source of the shapes: identity modes of ICT-FaceKit Light, learned from scans of people (MIT licence)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

#: Number of vertices of face, head and neck; those of the insides of mouth and eye sockets, eyes and teeth follow.
N_SKIN = 11248
_SKIN_MATERIALS = ("M_Face", "M_BackHead")
_EYE_COLOURS = {"Sclera": (235.0, 230.0, 228.0), "Iris": (70.0, 50.0, 40.0)}
_PLAIN = (200.0, 170.0, 155.0)


@dataclass(frozen=True, eq=False)
class ScannedPeople:
    """A mean head and the modes in which people differ, in centimetres, y up, facing +z.

    Attributes:
        mean: Vertices, shape (M, 3); the first `N_SKIN` are those of the skin.
        modes: Offsets per standard deviation, shape (K, M, 3).
        quads: Quads of the skin, without sockets and mouth, shape (F, 4).
        shown: Quads of the parts that are seen, with eyes, shape (G, 4).
        colours: Colours of the vertices, 0 to 255, shape (M, 3).
        landmarks: The 68 landmarks of the scheme of Multi-PIE, shape (68,).
    """

    mean: Floats
    modes: NDArray[np.float16]
    quads: Ints
    shown: Ints
    colours: Floats
    landmarks: NDArray[np.int64]

    @classmethod
    def read(cls, path: Path) -> "ScannedPeople":
        """Read the array file ``path``."""
        with np.load(path, allow_pickle=False) as data:
            mean, names = data["mean"].astype(np.float64), data["material_names"].tolist()
            faces, material = data["faces"].astype(np.int32), data["material"]
            skin = faces[np.isin(material, [names.index(name) for name in _SKIN_MATERIALS])]
            colours = np.tile(np.array(_PLAIN), (len(mean), 1))
            eyes = []
            for number, name in enumerate(names):
                for part, colour in _EYE_COLOURS.items():
                    if part in name:
                        eyes.append(faces[material == number])
                        colours[eyes[-1][eyes[-1] >= 0]] = colour
            shown = np.concatenate([skin, *eyes])
            quads = skin[(skin < N_SKIN).all(axis=1)]
            return cls(mean, data["modes"], quads, shown, colours, data["landmarks68"])

    @property
    def triangles(self) -> Ints:
        """Triangles of the skin, shape (T, 3)."""
        return self.quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)


def rings(quads: Ints, start: NDArray[np.integer], count: int) -> list[NDArray[np.int64]]:
    """Return the vertices at 0 to ``count`` quads from those of ``start``."""
    ring = np.asarray(start, dtype=np.int64)
    seen, found = ring, [ring]
    for _ in range(count):
        ring = np.setdiff1d(np.unique(quads[np.isin(quads, ring).any(axis=1)]), seen)
        seen = np.concatenate([seen, ring])
        found.append(ring)
    return found


def openings(quads: Ints) -> list[NDArray[np.int64]]:
    """Return the vertices of the borders of a mesh, each in order."""
    edges = np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2).tolist()
    both = {(b, a) for a, b in edges}
    onward = {a: b for a, b in edges if (a, b) not in both}
    loops = []
    while onward:
        start, vertex = next(iter(onward.items()))
        del onward[start]
        loop = [start]
        while vertex != start:
            loop.append(vertex)
            vertex = onward.pop(vertex)
        loops.append(np.array(loop))
    return loops
