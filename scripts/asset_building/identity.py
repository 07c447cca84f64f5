"""The two human characters: their identity targets, and levelling of the end of the neck."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import spsolve

from scripts.asset_building.piece import Floats, Ints
from scripts.asset_building.source import Source

#: Folders of targets with separate left and right versions.
_SIDED = ("eyes/", "ears/", "cheek/")

#: Height, in decimetres of the base mesh, above which levelling the neck's end has no effect.
NECK_TOP = 6.15
#: Difference in height of the neck's end between front and back, in centimetres.
_NECK_DROP = 1.5
#: Overlap of closed lips, and distance from their contact in which they are moved, in centimetres.
_LIP_OVERLAP, _CORNER_OVERLAP, _LIP_REACH = 0.03, 0.17, 0.45


@dataclass(frozen=True)
class Recipe:
    """Recipe of one person.

    Attributes:
        name: File name of the character.
        title: Displayed name.
        targets: Strength of each identity target.
        lids_relaxed: Strength of the face units eyeBlink that lower the lids slightly, since the source's eyes stare.
        lips_closed: Strength of the face unit mouthClose, since the source's lips are parted.
        neck_slim: Factor on the width of the neck's end.
        lash_length: Factor on the length of the eyelashes.
        hair_height: Height of the hair over the head, in centimetres.
        eye_forward: Offset of the eyeballs between the lids relative to the source, in radii: corneas reach about as
            far as the lids' edges, as in people.
    """

    name: str
    title: str
    targets: dict[str, float]
    lids_relaxed: float
    lips_closed: float
    neck_slim: float
    lash_length: float
    hair_height: float
    eye_forward: float = 0.05


MAN = Recipe(
    name="man",
    title="Man",
    targets={
        "macrodetails/caucasian-male-young": 1.0,
        "macrodetails/universal-male-young-averagemuscle-averageweight": 1.0,
        "eyes/eye-height2-incr": 0.3,
        "eyes/eye-scale-incr": 0.2,
        "nose/nose-width3-decr": 0.3,
        "nose/nose-scale-horiz-decr": 0.2,
        "nose/nose-scale-depth-decr": 0.3,
        "nose/nose-scale-vert-decr": 0.2,
        "chin/chin-prominent-incr": 0.3,
        "chin/chin-bones-incr": 0.15,
        "cheek/cheek-bones-incr": 0.35,
        "cheek/cheek-inner-decr": 0.3,
        "cheek/cheek-volume-decr": 0.25,
        "eyebrows/eyebrows-trans-forward": 0.15,
        "mouth/mouth-scale-horiz-incr": 0.1,
        "head/head-rectangular": 0.12,
        "head/head-scale-vert-decr": 0.2,
        "head/head-oval": 0.15,
    },
    lids_relaxed=0.07,
    lips_closed=0.07,
    neck_slim=0.9,
    lash_length=0.8,
    hair_height=0.2,
)

WOMAN = Recipe(
    name="woman",
    title="Woman",
    targets={
        "macrodetails/caucasian-female-young": 1.0,
        "macrodetails/universal-female-young-averagemuscle-averageweight": 1.0,
        "eyes/eye-height2-incr": 0.3,
        "eyes/eye-scale-incr": 0.35,
        "eyes/eye-corner2-up": 0.3,
        "nose/nose-width3-decr": 0.35,
        "nose/nose-scale-horiz-decr": 0.25,
        "nose/nose-point-up": 0.15,
        "chin/chin-triangle": 0.3,
        "chin/chin-width-decr": 0.3,
        "cheek/cheek-bones-incr": 0.4,
        "head/head-oval": 0.35,
        "mouth/mouth-upperlip-volume-incr": 0.25,
        "mouth/mouth-lowerlip-volume-incr": 0.15,
        "neck/neck-scale-horiz-decr": 0.2,
        "head/head-scale-vert-decr": 0.2,
        "forehead/forehead-temple-incr": 0.2,
    },
    lids_relaxed=0.08,
    lips_closed=0.08,
    neck_slim=0.95,
    lash_length=1.0,
    hair_height=0.5,
)

RECIPES = (MAN, WOMAN)


def identity_vertices(source: Source, rest: Floats, recipe: Recipe) -> Floats:
    """Return the whole base mesh, ``rest`` (N, 3) in centimetres, in the shape of the person of ``recipe``."""
    vertices = rest + 10.0 * recipe.lips_closed * source.face_unit("mouthClose", len(rest))
    for unit in ("eyeBlinkLeft", "eyeBlinkRight"):
        vertices = vertices + 10.0 * recipe.lids_relaxed * source.face_unit(unit, len(rest))
    for name, strength in recipe.targets.items():
        folder, _, detail = name.partition("/")
        names = [f"{folder}/{side}-{detail}" for side in "lr"] if name.startswith(_SIDED) else [name]
        for target in names:
            vertices = vertices + 10.0 * strength * source.target(target, len(rest))
    return vertices


def close_lips(vertices: Floats, loop: Ints) -> Floats:
    """Return the skin's control mesh with upper and lower lip closed along their contact.

    Args:
        vertices: Positions in centimetres, shape (N, 3).
        loop: The loop of vertices along which the lips touch, shape (L,).
    """
    loop = np.roll(loop, -int(vertices[loop, 0].argmax()))
    end = int(vertices[loop, 0].argmin())
    chains = [loop[: end + 1][::-1], np.append(loop[end:], loop[0])]
    chains.sort(key=lambda chain: vertices[chain, 1].mean())
    (lower_x, lower_y), (upper_x, upper_y) = (vertices[chain, :2].T for chain in chains)
    x, y = vertices[:, 0], vertices[:, 1]
    gap = np.interp(x, upper_x, upper_y) - np.interp(x, lower_x, lower_y)
    middle = np.interp(x, lower_x, lower_y) + 0.5 * gap
    result = vertices.copy()
    for chain, half, towards in ((chains[0], y <= middle, 0.5), (chains[1], y > middle, -0.5)):
        inner = chain[1:-1]
        # Subdivision rounds the loop's corners, which would open them again.
        overlap = _LIP_OVERLAP + _CORNER_OVERLAP * np.abs(x[inner] / x[loop].max()) ** 3
        rise = towards * np.maximum(gap[inner] + overlap, 0.0)
        near = np.exp(-((np.linalg.norm(vertices[half][:, None] - vertices[inner][None], axis=2) / _LIP_REACH) ** 2))
        result[half, 1] += near @ rise / np.maximum(near.sum(axis=1), 1e-12) * near.max(axis=1)
    return result


def level_neck(vertices: Floats, quads: Ints, loop: Ints, fixed: NDArray[np.bool_], recipe: Recipe) -> Floats:
    """Return the skin's control mesh with its border ``loop`` in one plane, the change fading out harmonically.

    Args:
        vertices: Positions in centimetres, shape (N, 3).
        quads: Vertex ids, shape (F, 4).
        loop: The vertices of the neck's border, shape (L,).
        fixed: Mask of the vertices to keep, shape (N,).
        recipe: The person.
    """
    end = vertices[loop]
    centre = end.mean(axis=0)
    depth = np.ptp(end[:, 2])
    wanted = end.copy()
    lowest = end[:, 1].min()
    wanted[:, 1] = lowest + _NECK_DROP * (end[:, 2].max() - end[:, 2]) / depth
    wanted[:, 0] *= recipe.neck_slim
    wanted[:, 2] = centre[2] + (wanted[:, 2] - centre[2]) * recipe.neck_slim

    n = len(vertices)
    a, b = np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2).T
    links = sparse.csr_array((np.ones(len(a)), (a, b)), shape=(n, n))
    links = links + links.T
    laplacian = sparse.csr_array(sparse.diags_array(links.sum(axis=1)) - links)
    known = fixed.copy()
    known[loop] = True
    change = np.zeros((n, 3))
    change[loop] = wanted - end
    change[~known] = spsolve(laplacian[~known][:, ~known].tocsc(), -laplacian[~known][:, known] @ change[known])
    return vertices + change
