"""Mirror correspondence of characters: of the mesh itself, or of the topology that heads share."""

from functools import lru_cache

import numpy as np

from faceposer.geometry.mirror import SurfaceMirror
from faceposer.model.character import Character
from faceposer.model.character_file import load_character

#: Largest distance of a point from the image of its partner, as a share of the head's height.
TOLERANCE = 0.003
# Share of vertices with a partner from which a mesh is its own measure of symmetry.
_SYMMETRIC = 0.9
# Character whose topology heads of the morphable model share, and which is symmetric.
_REFERENCE = "man"


@lru_cache(maxsize=3)
def character_mirror(character: Character, tolerance: float = TOLERANCE) -> SurfaceMirror:
    """Return the mirror correspondence of the neutral ``character``, up to ``tolerance`` times its height.

    Faces of people are not symmetric: on a head of the built-in man's topology, such as one from a scan, points across
    are those that are across on the man.
    """
    own = SurfaceMirror(character.vertices, character.triangles, tolerance * character.height)
    if np.mean(own.vertices >= 0) >= _SYMMETRIC:
        return own
    reference = load_character(_REFERENCE)
    if character.polygons.shape != reference.polygons.shape or not np.array_equal(
        character.polygons, reference.polygons
    ):
        return own
    return SurfaceMirror(reference.vertices, reference.triangles, tolerance * reference.height)
