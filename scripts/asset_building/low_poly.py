"""Build the low-poly head: triangles, fewer where little is visible or moves, with ARKit's shapes."""

from dataclasses import replace

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from faceposer.identity.anatomy.lids import close_exactly, keep_clear, upper_and_lower
from faceposer.identity.anatomy.loops import LASH_RING, fine_loop, ordered_ring
from faceposer.model.character import ARKIT_SHAPES, Character
from scripts.asset_building.builder import CREDITS, SIDES, Builder, Eyeball, centred
from scripts.asset_building.decimation import Decimation
from scripts.asset_building.eyes import LOW_DETAIL, build_eye
from scripts.asset_building.halves import in_halves
from scripts.asset_building.head import Skin
from scripts.asset_building.identity import Recipe, identity_vertices
from scripts.asset_building.landmarks import feature_points, mirrored_ids, regions
from scripts.asset_building.lids import meet_exactly, socket_ids, tuck_inner_edge
from scripts.asset_building.looks import LOOKS
from scripts.asset_building.piece import Floats, Ints, Piece, join
from scripts.asset_building.refinement import Reduced, reduced
from scripts.asset_building.simple_mouth import build_simple_mouth, paint_bands
from scripts.asset_building.symmetry import even
from scripts.asset_building.textures import jpeg, paint, vertex_masks

LOW = Recipe(
    name="low",
    title="Low-poly head",
    targets={
        "macrodetails/african-male-young": 0.75,
        "macrodetails/asian-male-young": 0.25,
        "macrodetails/universal-male-young-averagemuscle-averageweight": 1.0,
        "eyes/eye-height2-incr": 0.3,
        "eyes/eye-scale-incr": 0.3,
        "nose/nose-scale-depth-decr": 0.2,
        "chin/chin-prominent-incr": 0.2,
        "cheek/cheek-bones-incr": 0.4,
        "head/head-square": 0.25,
        "head/head-scale-vert-decr": 0.2,
    },
    lids_relaxed=0.06,
    lips_closed=0.08,
    neck_slim=0.9,
    lash_length=0.0,
    hair_height=0.25,
)
#: Number of vertices of the skin's left half, including the middle.
_HALF_SKIN = 590
#: Poses of the simplification, in addition to the neutral one.
_POSES = (
    ("jawOpen",),
    ("mouthSmileLeft", "cheekSquintLeft"),
    ("mouthFrownLeft", "browDownLeft", "noseSneerLeft"),
    ("mouthPucker",),
    ("eyeBlinkLeft",),
    ("browInnerUp", "browOuterUpLeft"),
    ("tongueOut", "jawOpen"),
)
#: Number of vertices to keep along the edge of each lid and, from corner to middle, of each lip.
_ON_LID, _ON_LIP = 11, 7
#: A ring on the lids that is preserved next to their edges, so that they fold evenly in between.
_FOLD_RING = LASH_RING + 2
#: A ring on their inner edges, so that the moist rim in front of the ball is a strip of even width.
_INNER_RING = LASH_RING - 2
#: Depth in the mouth, in centimetres, to which the insides of the lips are visible.
_LIP_DEPTH = 0.6
#: Overlap of the coarse edges of closed lids, in centimetres, and number of iterations to reach it.
_LIP_OVERLAP, _ROUNDS = 0.04, 4
#: Places on the red of the upper lip whose vertices are kept in place of those of the feature points, which are at its
#: edge: the order of vertices in files does not change.
_UPPER_LIP = {"8.1": (0.0, 66.71, 16.01), "8.5": (1.45, 66.55, 15.45), "8.10": (0.45, 66.86, 15.95)}
#: The peak of the lip, where the coarse mesh has a vertex at its edge.
_LIP_PEAK = {"8.10": (1.0, 67.15, 15.75)}
#: Factor on the eyeball's size, so that its facets do not intersect those of the lids.
_EYE_SCALE = 0.975


def build_low(builder: Builder) -> Character:
    """Build the low-poly head."""
    skin, place = builder.skin, builder.place
    everyone = even(identity_vertices(builder.source, builder.rest, LOW), builder.mirror)
    pieces = builder.pieces(everyone, builder.units, LOW)
    masks = vertex_masks(builder.source, skin)
    fine_points, _ = feature_points(skin, place, join(pieces).parts, elsewhere=_UPPER_LIP)
    named = regions(skin, place, masks, ())
    mesh = _simplified_skin(skin, pieces[0], place, named, list(fine_points.values()))
    number = mesh.index(len(place))
    eyes = [builder.eyeball(side, pieces[0].vertices, LOW) for side in SIDES]
    low_skin = _closing(mesh.applied(pieces[0]), skin, number, eyes)
    contact = number[fine_loop(skin.fine, skin.lip_contact)]
    low_skin = replace(low_skin, vertices=_sealed(low_skin.vertices, contact[contact >= 0]))
    parts = [low_skin, *(_eye(eye) for eye in eyes)]
    parts += build_simple_mouth(builder.mouth_frame(everyone, pieces[0].vertices), builder.jaw(everyone, builder.units))
    joined = join(parts)
    named = regions(skin, place, masks, joined.parts)
    kept = {name: ids if name.startswith("eye_") else number[ids] for name, ids in named.items()}
    points, titles = feature_points(skin, place, joined.parts, mesh.kept, _LIP_PEAK)
    names, shapes = in_halves(ARKIT_SHAPES, joined.shapes, joined.vertices[:, 0])
    textures = paint(builder.texels, LOOKS[LOW.name])
    wanted = {name: textures[name] for name in ("skin", "eye", "tongue", "throat")} | {"teeth": jpeg(paint_bands(), 90)}
    return Character(
        name=LOW.name,
        title=LOW.title,
        vertices=centred(joined).astype(np.float32),
        polygons=joined.quads,
        uv=joined.uv.astype(np.float32),
        polygon_uvs=joined.quad_uvs,
        parts=joined.parts,
        shape_names=names,
        shapes=shapes.astype(np.float32),
        regions={name: ids[ids >= 0] for name, ids in kept.items()},
        feature_points=points,
        feature_titles=titles,
        textures=wanted,
        credits=CREDITS,
    )


def _eye(eye: Eyeball) -> Piece:
    return build_eye(eye.side, eye.centre, _EYE_SCALE * eye.radius, ARKIT_SHAPES, LOW_DETAIL)


def _simplified_skin(skin: Skin, piece: Piece, place: Floats, named: dict[str, Ints], points: list[int]) -> Reduced:
    """Return a symmetric triangle mesh on a subset of the fine skin's vertices."""
    mirror = mirrored_ids(place)
    lash = fine_loop(skin.fine, ordered_ring(skin.quads, skin.rings_left[LASH_RING]))
    lips = fine_loop(skin.fine, skin.lip_contact)
    keep = [np.array([vertex for vertex in points if vertex < len(place)])]
    keep += [_spaced(half, place, _ON_LID) for half in upper_and_lower(place, lash, "Left")]
    keep += [_spaced(half[place[half, 0] > -1e-6], place, _ON_LIP) for half in upper_and_lower(place, lips, "Left")]
    fold = fine_loop(skin.fine, ordered_ring(skin.quads, skin.rings_left[_FOLD_RING]))
    keep += [_spaced(half, place, _ON_LID) for half in upper_and_lower(place, fold, "Left")]
    inner = fine_loop(skin.fine, ordered_ring(skin.quads, skin.rings_left[_INNER_RING]))
    keep += [_spaced(half, place, _ON_LID) for half in upper_and_lower(place, inner, "Left")]
    loops = [_closed(lash), _closed(fold), _closed(inner), _closed(lips)]
    weights = np.full(len(place), 0.35)
    for region, weight in (
        ("forehead", 0.9),
        ("cheek_left", 1.2),
        ("jaw", 0.6),
        ("nose", 1.5),
        ("brow_left", 2.5),
        ("mouth", 2.2),
        ("lip_upper", 2.5),
        ("lip_lower", 2.5),
        ("lids_left", 3.5),
        ("neck", 0.08),
        ("scalp", 0.07),
        ("ear_left", 0.35),
    ):
        weights[named[region]] = weight
    in_socket = np.isin(skin.quads, np.concatenate(skin.rings_left[: LASH_RING - 2])).any(axis=1)
    hidden = np.unique(skin.fine.quads[np.repeat(in_socket | skin.in_mouth, 4)])
    behind_lips = cKDTree(place[lips]).query(place[hidden])[0] > _LIP_DEPTH
    weights[hidden] *= np.where(behind_lips, 0.04, 0.6)
    return _half_simplified(piece, place, mirror, np.concatenate(loops), np.concatenate(keep), weights, _HALF_SKIN)


def _half_simplified(
    piece: Piece, place: Floats, mirror: Ints, lines: Ints, keep: Ints, weights: Floats, n_vertices: int
) -> Reduced:
    """Return ``piece`` with its left half simplified to ``n_vertices`` and mirrored to the right.

    Args:
        piece: A symmetric mesh of quads with ARKit's shapes, none of which crosses the middle.
        place: Exactly symmetric positions of its vertices, shape (N, 3).
        mirror: The vertex opposite each, shape (N,).
        lines: Edges to preserve, shape (L, 2), in addition to the borders and the seams of the texture.
        keep: Vertices to keep.
        weights: Weight of an error at each vertex, shape (N,).
        n_vertices: Number of vertices of the result.
    """
    quads = piece.quads
    chart = _charts(quads, piece.quad_uvs, len(piece.uv))
    left = np.flatnonzero(place[quads].min(axis=1)[:, 0] > -1e-6)
    halves = quads[left][:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    of_quad = np.repeat(left, 2)
    borders = _borders(quads[left], chart[left])
    edges = np.concatenate([borders, lines[(place[lines, 0] > -1e-6).all(axis=1)]])
    shapes = {name: piece.shapes[k] for k, name in enumerate(ARKIT_SHAPES)}
    poses = [piece.vertices, *(piece.vertices + sum(shapes[name] for name in names) for names in _POSES)]
    keep = keep[place[keep, 0] > -1e-6]
    flat = np.zeros((int(chart.max()) + 1, len(place), 2))
    flat[np.repeat(chart[left], 4), quads[left].ravel()] = piece.uv[piece.quad_uvs[left].ravel()]
    moved = np.round(np.stack(poses), 5)
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    work = Decimation(moved, halves, weights, edges, keep, chart[of_quad], flat)
    work.run(n_vertices)

    side = np.where(place[quads].mean(axis=1)[:, 0] > 0.0, 0, 1)
    codes: dict[tuple[int, int, int], int] = {}
    for code, (vertex, c, s) in enumerate(
        zip(quads.ravel().tolist(), np.repeat(chart, 4).tolist(), np.repeat(side, 4).tolist(), strict=True)
    ):
        codes.setdefault((vertex, c, s), code)
    opposite = _opposite_quads(quads, mirror)
    corners = []
    for number, triangle in sorted(work.triangles.items()):
        quad = int(of_quad[number])
        corners.append([codes[vertex, int(chart[quad]), 0] for vertex in triangle])
        corners.append([codes[int(mirror[vertex]), int(chart[opposite[quad]]), 1] for vertex in triangle[::-1]])
    return reduced(quads, np.pad(np.array(corners), ((0, 0), (0, 1)), constant_values=-1))


def _spaced(line: Ints, place: Floats, count: int) -> Ints:
    """Return ``count`` vertices of ``line``, including its ends, spread in x and denser towards the ends."""
    x = place[line, 0]
    wanted = x[0] + (x[-1] - x[0]) * (0.5 - 0.5 * np.cos(np.pi * np.linspace(0.0, 1.0, count)))
    return line[np.abs(x[None, :] - wanted[:, None]).argmin(axis=1)]


def _closed(loop: Ints) -> Ints:
    """Return the edges of a closed loop, shape (L, 2)."""
    return np.stack([loop, np.roll(loop, -1)], axis=1)


def _charts(quads: Ints, quad_uvs: Ints, n_uv: int) -> Ints:
    """Return the index of the texture chart of each quad, shape (F,)."""
    a, b = quad_uvs.ravel(), np.roll(quad_uvs, -1, axis=1).ravel()
    _, label = connected_components(sparse.coo_array((np.ones(len(a)), (a, b)), shape=(n_uv, n_uv)), directed=False)
    chart: Ints = label[quad_uvs[:, 0]]
    return chart


def _borders(quads: Ints, chart: Ints) -> Ints:
    """Return the edges with no quad of the same chart on the other side, shape (B, 2)."""
    sides = np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2)
    label = np.repeat(chart, 4)
    have = {(a, b): c for (a, b), c in zip(sides.tolist(), label.tolist(), strict=True)}
    found = [(a, b) for (a, b), c in have.items() if have.get((b, a)) != c]
    return np.array(found, dtype=np.int32).reshape(-1, 2)


def _opposite_quads(quads: Ints, mirror: Ints) -> Ints:
    """Return the quad opposite each in x, shape (F,)."""
    number = {frozenset(quad): k for k, quad in enumerate(quads.tolist())}
    return np.array([number[frozenset(quad)] for quad in mirror[quads].tolist()], dtype=np.int32)


def _sealed(vertices: Floats, contact: Ints) -> Floats:
    """Return the simplified skin's vertices with the lips closed along ``contact``, the loop of their edges."""
    result = vertices.copy()
    upper, lower = (half[1:-1] for half in upper_and_lower(vertices, contact, "Left"))
    for _ in range(_ROUNDS):
        for half, other, sign in ((upper, lower, 1.0), (lower, upper, -1.0)):
            opposite = np.interp(result[half, 0], result[other, 0], result[other, 1])
            apart = sign * (result[half, 1] - opposite) + _LIP_OVERLAP
            result[half, 1] -= 0.5 * sign * np.maximum(apart, 0.0)
    return result


def _closing(low: Piece, skin: Skin, number: Ints, eyes: list[Eyeball]) -> Piece:
    """Return the simplified skin with blinks adapted to its coarser lids."""
    shapes = low.shapes.copy()
    ring = fine_loop(skin.fine, ordered_ring(skin.quads, skin.rings_left[LASH_RING]))
    mirror = mirrored_ids(low.vertices)
    inner = fine_loop(skin.fine, ordered_ring(skin.quads, skin.rings_left[_INNER_RING]))
    kept, kept_inner = (number[loop][number[loop] >= 0] for loop in (ring, inner))
    for eye in eyes:
        blink = ARKIT_SHAPES.index(f"eyeBlink{eye.side}")
        loop, edge = (ids if eye.side == "Left" else mirror[ids] for ids in (kept, kept_inner))
        shapes[blink] = close_exactly(low.vertices, shapes[blink], loop, eye.side)
        socket = number[socket_ids(skin, eye.side)]
        shapes = keep_clear(
            low.vertices, shapes, socket[socket >= 0], eye.centre, _EYE_SCALE * eye.radius, (1.0, 0.75, 0.5, 0.25)
        )
        shapes[blink] = meet_exactly(low.vertices, shapes[blink], loop, eye.centre, low.quads[:, :3])
        shapes[blink] = tuck_inner_edge(low.vertices, shapes[blink], loop, edge, eye.centre)
    return replace(low, shapes=shapes)
