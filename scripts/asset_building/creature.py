"""Build the creature: a goblin without a rig, but with fifty example expressions."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from faceposer.identity.anatomy.lids import keep_clear
from faceposer.identity.anatomy.loops import LASH_RING
from faceposer.model.character import ARKIT_SHAPES, Character
from scripts.asset_building.builder import CREDITS, SIDES, Builder, centred
from scripts.asset_building.creature_expressions import EXPRESSIONS
from scripts.asset_building.creature_units import goblin_units
from scripts.asset_building.ears import EarShape, ear_freedom, point_ears, turn_ears
from scripts.asset_building.eyes import turned_eye
from scripts.asset_building.head import Skin
from scripts.asset_building.identity import Recipe, identity_vertices
from scripts.asset_building.landmarks import feature_points, regions
from scripts.asset_building.lids import socket_ids
from scripts.asset_building.looks import LOOKS
from scripts.asset_building.piece import Floats, Ints, Piece, join
from scripts.asset_building.refinement import Reduced, refined_in_places
from scripts.asset_building.swell import Swell, swollen
from scripts.asset_building.symmetry import even
from scripts.asset_building.textures import paint, vertex_masks
from scripts.asset_building.transfer import fitted_units

CREATURE = Recipe(
    name="creature",
    title="Goblin",
    targets={
        "macrodetails/caucasian-male-old": 0.6,
        "macrodetails/asian-male-young": 0.4,
        "macrodetails/universal-male-young-averagemuscle-averageweight": 0.8,
        "ears/ear-shape-pointed": 1.0,
        "ears/ear-scale-incr": 1.0,
        "ears/ear-scale-vert-incr": 0.5,
        "ears/ear-wing-incr": 1.3,
        "ears/ear-flap-incr": 0.3,
        "ears/ear-lobe-decr": 1.0,
        "eyes/eye-scale-incr": 1.0,
        "eyes/eye-height2-incr": 0.6,
        "eyes/eye-trans-out": 0.5,
        "eyes/eye-corner2-up": 0.8,
        "nose/nose-scale-vert-decr": 0.6,
        "nose/nose-scale-depth-decr": 0.6,
        "nose/nose-curve-convex": 0.4,
        "nose/nose-flaring-incr": 0.8,
        "nose/nose-point-down": 0.4,
        "nose/nose-width3-incr": 0.4,
        "chin/chin-triangle": 0.7,
        "chin/chin-width-decr": 0.5,
        "chin/chin-prominent-incr": 0.6,
        "chin/chin-height-incr": 0.2,
        "cheek/cheek-bones-incr": 1.2,
        "cheek/cheek-inner-decr": 0.6,
        "cheek/cheek-volume-decr": 0.4,
        "head/head-invertedtriangular": 0.6,
        "head/head-scale-horiz-incr": 0.6,
        "head/head-scale-vert-decr": 1.6,
        "head/head-square": 0.4,
        "forehead/forehead-nubian-incr": 0.4,
        "forehead/forehead-temple-incr": 0.4,
        "mouth/mouth-scale-horiz-incr": 1.0,
        "mouth/mouth-upperlip-height-decr": 0.6,
        "mouth/mouth-lowerlip-height-decr": 0.4,
        "mouth/mouth-laugh-lines-in": 0.8,
        "eyebrows/eyebrows-angle-up": 0.6,
        "neck/neck-scale-vert-decr": 1.0,
        "neck/neck-scale-horiz-decr": 0.8,
        "neck/neck-scale-depth-decr": 0.5,
    },
    lids_relaxed=0.06,
    lips_closed=0.07,
    neck_slim=0.7,
    lash_length=0.0,
    hair_height=0.0,
    eye_forward=0.02,
)
_EARS = EarShape(reach=(5.4, 3.4, -1.8), sharpness=1.5, narrowing=0.4)
#: Large eyes and a wide mouth.
_SWELLS = (
    Swell((3.3, 73.0, 13.0), (3.2, 2.6, 4.5), (1.42, 1.50, 1.15)),
    Swell((0.0, 66.0, 14.0), (4.2, 2.2, 5.0), (1.2, 1.0, 1.0)),
)
#: Factors on width and, below the lips, depth of the inside of the mouth, to fit the small jaw.
_MOUTH_NARROWER, _MOUTH_SHALLOWER = 0.38, 0.15
#: Edge length in centimetres above which the skin is subdivided, as it is along the lids' edges and the lips.
_LONGEST_EDGE = 1.4
#: Distance around its large eyeballs, in centimetres, in which skin is kept off them.
_LID_REACH = 2.2
#: Rotation of the left ear for each unit at full strength, as a rotation vector in degrees.
_EAR_TURNS = {
    "earUp": (0.0, 0.0, 22.0),
    "earDown": (0.0, 0.0, -42.0),
    "earBack": (0.0, 34.0, 0.0),
    "earForward": (0.0, -26.0, 0.0),
}


def build_creature(
    builder: Builder, expressions: Mapping[str, dict[str, float]] = EXPRESSIONS
) -> tuple[Character, NDArray[np.float32]]:
    """Return the creature, a character without shapes, and its faces in the examples, or in other ``expressions``.

    Returns:
        The neutral face, and the vertices of the faces in the order of the expressions, shape (E, N, 3), in
        centimetres in the character's coordinates.
    """
    everyone, free = _creature_vertices(builder)
    head = builder.rest[:, 1] > 55.0
    units = goblin_units(fitted_units(builder.rest, everyone, builder.units, head), builder.rest)
    pieces = builder.pieces(everyone, units, CREATURE)
    skin = builder.skin
    weights = np.stack([_unit_weights(expression) for expression in expressions.values()])
    examples = [replace(piece, shapes=np.tensordot(weights, piece.shapes, axes=1)) for piece in pieces]
    examples[0] = _finished_skin(builder, examples[0], skin.fine.matrix @ free[skin.base_ids], expressions)
    for k, side in enumerate(SIDES):
        examples[k + 1] = replace(examples[k + 1], shapes=_turned(pieces[k + 1], side, weights))
    masks = vertex_masks(builder.source, skin)
    brows = regions(skin, builder.place, masks, ())
    mesh = _mesh(skin, pieces[0].vertices, np.concatenate([brows["brow_left"], brows["brow_right"]]))
    examples[0] = mesh.applied(examples[0])
    joined = join(examples)
    number = mesh.index(len(builder.place))
    # The regions of the eyes index the character's vertices, all others those of the whole skin.
    named = regions(skin, builder.place, masks, joined.parts)
    kept = {name: ids if name.startswith("eye_") else number[ids] for name, ids in named.items()}
    points, titles = feature_points(skin, builder.place, joined.parts, mesh.kept)
    neutral = centred(joined)
    character = Character(
        name=CREATURE.name,
        title=CREATURE.title,
        vertices=neutral.astype(np.float32),
        polygons=joined.quads,
        uv=joined.uv.astype(np.float32),
        polygon_uvs=joined.quad_uvs,
        parts=joined.parts,
        shape_names=(),
        shapes=np.zeros((0, len(neutral), 3), dtype=np.float32),
        regions={name: ids[ids >= 0] for name, ids in kept.items()},
        feature_points=points,
        feature_titles=titles,
        textures=paint(builder.texels, LOOKS[CREATURE.name]),
        credits=CREDITS,
    )
    return character, (neutral + joined.shapes).astype(np.float32)


def _creature_vertices(builder: Builder) -> tuple[Floats, Floats]:
    """Return the base mesh in the shape of the creature, (N, 3), and weights of the free parts of its ears, (N,)."""
    rest, skin = builder.rest, builder.skin
    vertices = even(identity_vertices(builder.source, rest, CREATURE), builder.mirror)
    ears = np.zeros(len(rest))
    ears[skin.base_ids] = vertex_masks(builder.source, skin)["ears"][: len(skin.base_ids)]
    ears = 0.5 * (ears + ears[builder.mirror])
    free = ear_freedom(rest, ears)
    vertices = point_ears(vertices, rest, free, _EARS)
    teeth = np.concatenate([builder.group(f"helper-{jaw}-teeth") for jaw in ("upper", "lower")])
    tongue = builder.group("helper-tongue")
    inside = np.union1d(np.union1d(teeth, tongue), skin.base_ids[np.unique(skin.quads[skin.in_mouth])])
    depth = np.clip((15.6 - rest[inside, 2]) / 2.6, 0.0, 1.0)
    depth = depth * depth * (3.0 - 2.0 * depth)
    lips = vertices[skin.base_ids[skin.lip_contact], 1].mean()
    below = np.minimum(vertices[inside, 1] - lips, 0.0)
    vertices[inside, 0] *= 1.0 - _MOUTH_NARROWER * depth
    vertices[inside, 1] -= _MOUTH_SHALLOWER * depth * below
    return even(swollen(vertices, rest, _SWELLS), builder.mirror), free


def _unit_weights(expression: dict[str, float]) -> Floats:
    """Return the strengths of ARKit's shapes in ``expression``, shape (52,)."""
    weights = np.zeros(len(ARKIT_SHAPES))
    for name, strength in expression.items():
        if not name.startswith("ear"):
            names = [name] if name in ARKIT_SHAPES else [name + side for side in SIDES]
            for one in names:
                weights[ARKIT_SHAPES.index(one)] = strength
    return weights


def _finished_skin(builder: Builder, skin: Piece, free: Floats, expressions: Mapping[str, dict[str, float]]) -> Piece:
    """Return the skin with its faces: ears turned, and lids kept off the eyeballs in each."""
    shapes = skin.shapes.copy()
    for k, expression in enumerate(expressions.values()):
        for side in SIDES:
            axis = np.zeros(3)
            for name, turn in _EAR_TURNS.items():
                axis += (expression.get(name, 0.0) + expression.get(name + side, 0.0)) * np.array(turn)
            if axis.any():
                shapes[k] += turn_ears(skin.vertices, builder.place, free, side, axis)
    for side in SIDES:
        eye = builder.eyeball(side, skin.vertices, CREATURE)
        ids = socket_ids(builder.skin, side)
        shapes = keep_clear(skin.vertices, shapes, ids, eye.centre, eye.radius, (1.0, 0.75, 0.5, 0.25), _LID_REACH)
    return replace(skin, shapes=shapes)


def _turned(eye: Piece, side: str, weights: Floats) -> Floats:
    """Return the offsets of an eyeball, rotated rigidly, in each face, shape (E, N, 3)."""
    gaze = [
        {
            action: row[ARKIT_SHAPES.index(f"eye{action}{side}")]
            for action in ("LookDown", "LookUp", "LookIn", "LookOut")
        }
        for row in weights
    ]
    return np.stack([turned_eye(eye.vertices, side, strengths) for strengths in gaze])


def _mesh(skin: Skin, vertices: Floats, brows: Ints) -> Reduced:
    """Return the mesh of the skin for the fine ``vertices``: finer in visible places and on the ``brows``."""
    corners = vertices[skin.quads]
    longest = np.round(np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).max(axis=1), 3)
    edge = np.concatenate([skin.rings_left[LASH_RING], skin.lip_contact, brows])
    along = np.isin(skin.quads, np.union1d(edge, skin.mirror[skin.rings_left[LASH_RING]])).any(axis=1)
    hidden: NDArray[np.bool_] = np.isin(skin.quads, np.concatenate(skin.rings_left[: LASH_RING - 2])).any(axis=1)
    hidden |= hidden[_mirrored_quads(skin)]
    chosen: NDArray[np.bool_] = along | ((longest > _LONGEST_EDGE) & ~skin.in_mouth & ~hidden)
    return refined_in_places(skin.fine, chosen | chosen[_mirrored_quads(skin)])


def _mirrored_quads(skin: Skin) -> NDArray[np.intp]:
    """Return the quad opposite each in x, shape (F,)."""
    key = np.sort(skin.quads, axis=1)
    opposite = np.sort(skin.mirror[skin.quads], axis=1)
    order, other = np.lexsort(key.T), np.lexsort(opposite.T)
    result = np.empty(len(key), dtype=np.intp)
    result[other] = order
    return result
