"""Assembly of characters."""

from dataclasses import dataclass

import numpy as np

from faceposer.geometry.mesh import VertexNormals
from faceposer.identity.anatomy.eyeballs import place_eye
from faceposer.identity.anatomy.lids import close_exactly, gaze_lids, keep_clear, tuck_socket
from faceposer.identity.anatomy.loops import LASH_RING, LID_RINGS, fine_loop, ordered_ring
from faceposer.model.character import ARKIT_SHAPES, Character
from scripts.asset_building.dental_arch import MouthFrame
from scripts.asset_building.eyes import build_eye
from scripts.asset_building.halves import in_halves
from scripts.asset_building.head import Skin, cut_skin, split_uv
from scripts.asset_building.identity import NECK_TOP, Recipe, close_lips, identity_vertices, level_neck
from scripts.asset_building.jaw_skin import JawSkin, jaw_skin
from scripts.asset_building.landmarks import feature_points, regions
from scripts.asset_building.lashes import build_lashes
from scripts.asset_building.lids import socket_ids
from scripts.asset_building.looks import LOOKS
from scripts.asset_building.mouth import JawMotion, build_mouth, jaw_hinge, mouth_frame, tuck_lining
from scripts.asset_building.mouth_shapes import LIP_REACH, MOUTH_REACH, around_lips, closed_again
from scripts.asset_building.piece import Floats, Ints, Joined, Piece, join
from scripts.asset_building.sculpting import sculpted
from scripts.asset_building.skin_texture import hair_depth
from scripts.asset_building.source import BaseMesh, Source
from scripts.asset_building.symmetry import even, even_units
from scripts.asset_building.textures import paint, skin_texels, vertex_masks
from scripts.asset_building.unwrap import Layout, texel_density, unwrap_skin

CREDITS = (
    "Mesh, identity targets and masks: MakeHuman's base mesh and MPFB (CC0 1.0). Expression shapes: Face Units 01 by "
    "Mika Suominen (CC0 1.0). Eyeballs, teeth, gums, lashes, layout and textures: Face Poser."
)
SIDES = ("Left", "Right")
_EYE_RADIUS = 1.43
_UPPER_TEETH, _LOWER_TEETH = "helper-upper-teeth", "helper-lower-teeth"
_EYES = {"Left": "helper-l-eye", "Right": "helper-r-eye"}


@dataclass(frozen=True)
class Eyeball:
    """Position of an eyeball: its side ("Left" or "Right"), centre (3,) and radius in centimetres."""

    side: str
    centre: Floats
    radius: float


class Builder:
    """Build characters; shared data is computed once."""

    def __init__(self, source: Source) -> None:
        """Read the base mesh and the face units from ``source``."""
        self.source = source
        self.base: BaseMesh = source.base_mesh()
        self.rest: Floats = 10.0 * self.base.vertices
        self.mirror = source.mirror(len(self.rest))
        self.skin: Skin = cut_skin(self.base, self.mirror)
        self.place: Floats = self.skin.fine.matrix @ self.rest[self.skin.base_ids]
        units = {name: 10.0 * source.face_unit(name, len(self.rest)) for name in ARKIT_SHAPES}
        even_source = even_units(units, self.mirror)
        self.units = sculpted(even_source, self.rest, self.skin)
        self.jaw_skin: JawSkin = jaw_skin(self.skin, self.rest, even_source[ARKIT_SHAPES.index("jawOpen")])
        rest_skin = self.rest[self.skin.base_ids]
        old = Layout(self.skin.base_uv, self.skin.base_quad_uvs)
        self.layout = unwrap_skin(rest_skin, self.skin.quads, old, texel_density(rest_skin))
        self.texels = skin_texels(source, self.skin, rest_skin, self.layout)

    def character(self, recipe: Recipe) -> Character:
        """Build the character of ``recipe``."""
        everyone = even(identity_vertices(self.source, self.rest, recipe), self.mirror)
        joined = join(self.pieces(everyone, self.units, recipe))
        points, titles = feature_points(self.skin, self.place, joined.parts)
        names, shapes = in_halves(ARKIT_SHAPES, joined.shapes, joined.vertices[:, 0])
        return Character(
            name=recipe.name,
            title=recipe.title,
            vertices=centred(joined).astype(np.float32),
            polygons=joined.quads,
            uv=joined.uv.astype(np.float32),
            polygon_uvs=joined.quad_uvs,
            parts=joined.parts,
            shape_names=names,
            shapes=shapes.astype(np.float32),
            regions=regions(self.skin, self.place, vertex_masks(self.source, self.skin), joined.parts),
            feature_points=points,
            feature_titles=titles,
            textures=paint(self.texels, LOOKS[recipe.name]),
            credits=CREDITS,
        )

    def pieces(self, everyone: Floats, units: Floats, recipe: Recipe) -> list[Piece]:
        """Return the parts of a head with ARKit's shapes, the skin first.

        Args:
            everyone: The base mesh in the identity of the head, symmetric, in centimetres, shape (N, 3).
            units: Offsets of the face units on it, shape (52, N, 3).
            recipe: Recipe of the head; lashes of length 0 are omitted.
        """
        vertices = self._skin_vertices(everyone, recipe)
        eyeballs = [self.eyeball(side, vertices, recipe) for side in SIDES]
        units = self._opened(everyone, units)
        skin = self._skin(vertices, units, eyeballs)
        pieces = [skin, *(build_eye(eye.side, eye.centre, eye.radius, ARKIT_SHAPES) for eye in eyeballs)]
        pieces += build_mouth(self.mouth_frame(everyone, vertices), self.jaw(everyone, units))
        for eye in eyeballs if recipe.lash_length else ():
            ring, lid = self._lash_ring(eye.side)
            pieces.append(build_lashes(eye.side, skin.vertices, skin.shapes, ring, lid, eye.centre, recipe.lash_length))
        return pieces

    def _opened(self, everyone: Floats, units: Floats) -> Floats:
        """Return ``units`` with jawOpen about the head's own hinge, and the matching mouthClose of the skin."""
        ids, result = self.skin.base_ids, units.copy()
        opens, closes = ARKIT_SHAPES.index("jawOpen"), ARKIT_SHAPES.index("mouthClose")
        hinge = jaw_hinge(everyone)
        opening = self.jaw_skin.opening(everyone[ids], hinge)
        lips, near = (around_lips(self.skin, self.rest[ids], reach) for reach in (LIP_REACH, MOUTH_REACH))
        result[opens, ids] = opening
        result[closes, ids] = closed_again(units[closes, ids], units[opens, ids], opening, lips, near)
        return result

    def mouth_frame(self, everyone: Floats, vertices: Floats) -> MouthFrame:
        """Return the frame of the inside of the mouth from the base mesh and the skin's ``vertices`` of a head."""
        return mouth_frame(self.skin, vertices, float(np.ptp(everyone[self.group(_UPPER_TEETH), 0])))

    def jaw(self, everyone: Floats, units: Floats) -> JawMotion:
        """Return the motion of the lower jaw in ``units`` (S, N, 3) of a head with base mesh ``everyone`` (N, 3)."""
        return JawMotion(jaw_hinge(everyone), units[:, self.group(_LOWER_TEETH)], ARKIT_SHAPES)

    def group(self, name: str) -> Ints:
        """Return the vertices of the base mesh's group ``name``, ascending, shape (n,)."""
        return np.unique(self.base.quads[self.base.groups == name])

    def _skin_vertices(self, everyone: Floats, recipe: Recipe) -> Floats:
        """Return the neutral skin, shape (N, 3)."""
        skin = self.skin
        fixed = self.base.vertices[skin.base_ids, 1] > NECK_TOP
        control = close_lips(tuck_lining(everyone[skin.base_ids], skin), skin.lip_contact)
        control = level_neck(control, skin.quads, skin.border, fixed, recipe)
        vertices = skin.fine.matrix @ control
        normals = VertexNormals(skin.fine.quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3), len(vertices))(vertices)
        depth = _smoothed(hair_depth(self.place.astype(np.float32)).astype(float), skin.fine.quads)
        return vertices + recipe.hair_height * depth[:, None] * normals

    def eyeball(self, side: str, vertices: Floats, recipe: Recipe) -> Eyeball:
        """Return the eyeball that fits the lids of ``side`` on the skin's ``vertices``, shape (N, 3), of ``recipe``."""
        lids = np.concatenate([self.skin.rings_left[k] for k in LID_RINGS])
        if side == "Right":
            lids = self.skin.mirror[lids]
        rest_centre = self.rest[self.group(_EYES[side])].mean(axis=0)
        centre, scale = place_eye(self.place[lids], vertices[lids], rest_centre)
        radius = _EYE_RADIUS * scale
        return Eyeball(side, centre + [0.0, 0.0, recipe.eye_forward * radius], radius)

    def _skin(self, vertices: Floats, units: Floats, eyeballs: list[Eyeball]) -> Piece:
        skin = self.skin
        shapes = np.stack([skin.fine.matrix @ unit[skin.base_ids] for unit in units])
        for eye in eyeballs:
            ring, _ = self._lash_ring(eye.side)
            blink = ARKIT_SHAPES.index(f"eyeBlink{eye.side}")
            shapes[blink] = close_exactly(vertices, shapes[blink], ring, eye.side)
            for action, offsets in gaze_lids(vertices, ring, eye.centre).items():
                shapes[ARKIT_SHAPES.index(f"eye{action}{eye.side}")] = offsets
            ids = socket_ids(skin, eye.side)
            vertices = tuck_socket(vertices, ids, eye.centre, eye.radius)
            shapes = keep_clear(vertices, shapes, ids, eye.centre, eye.radius)
        uv, quad_uvs = split_uv(self.layout.uv, self.layout.quad_uvs)
        return Piece("skin", "skin", vertices, skin.fine.quads, uv, quad_uvs, shapes)

    def _lash_ring(self, side: str) -> tuple[Ints, Ints]:
        """Return the loop of skin vertices that carries the lashes and those of the lid around it."""
        ring = ordered_ring(self.skin.quads, self.skin.rings_left[LASH_RING])
        lid = np.concatenate(self.skin.rings_left[LASH_RING - 2 : LASH_RING + 4])
        if side == "Right":
            ring, lid = self.skin.mirror[ring], self.skin.mirror[lid]
        return fine_loop(self.skin.fine, ring), lid


def centred(joined: Joined) -> Floats:
    """Return the vertices translated so that the origin is inside the head, with the skin as first part."""
    skin = joined.vertices[slice(*joined.parts[0].vertices)]
    low, high = skin.min(axis=0), skin.max(axis=0)
    result: Floats = joined.vertices - [0.0, high[1] - 12.5, 0.5 * (low[2] + high[2])]
    return result


def _smoothed(values: Floats, quads: Ints, rounds: int = 12) -> Floats:
    """Return ``values`` (N,) averaged repeatedly with those of their neighbours in the mesh."""
    a, b = np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2).T
    count = np.bincount(a, minlength=len(values)) + np.bincount(b, minlength=len(values))
    for _ in range(rounds):
        around = np.bincount(a, values[b], len(values)) + np.bincount(b, values[a], len(values))
        values = 0.5 * values + 0.5 * around / count
    return values
