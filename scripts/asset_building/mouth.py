"""Inside of the mouth: teeth, gums, palate, throat and tongue, placed in a head and moved by its jaw."""

from collections.abc import Callable, Sequence

import numpy as np

from faceposer.identity.anatomy.jaw import condyle, jaw_opening
from scripts.asset_building.dental_arch import LOWER, UPPER, MouthFrame, smooth
from scripts.asset_building.gums import build_gum, build_throat
from scripts.asset_building.head import Skin
from scripts.asset_building.piece import Floats, Ints, Piece
from scripts.asset_building.teeth import build_crowns
from scripts.asset_building.tongue import build_tongue

#: Vertices of the base mesh in the middle of the inner side of the upper and the lower lip.
_INNER_LIPS = (554, 537, 520, 557, 574)
#: Width of the base mesh's band of upper teeth on the man, in centimetres, for which teeth have their original size.
_MAN_BAND = 6.94
#: Distances of the edges of the upper incisors below the line where the lips meet and behind the lips' inner side, in
#: centimetres of a man.
_BELOW_LIPS, _BEHIND_LIPS = 0.25, 0.16
#: The lining of the mouth reaches far above the palate in the base mesh, up to the nostrils: above this
#: height over the line of the lips it is lowered by this factor, and its front moved back, in centimetres.
_LINING_FROM, _LINING_FACTOR, _LINING_BACK = 0.9, 0.62, 0.40
#: Share of its way out at which the tongue turns with the jaw, so that it follows the lip when out.
_TONGUE_AHEAD = 0.35
#: The base mesh's vertex on the skin over the left condyle: in front of the ear, at the height of its canal.
_BEFORE_EAR = 12347
_JAW_SHIFTS = ("jawForward", "jawLeft", "jawRight")


def jaw_hinge(vertices: Floats) -> Floats:
    """Return the point of `condyle`, (3,), of a head with the symmetric base mesh ``vertices``, (N, 3)."""
    return condyle(vertices[_BEFORE_EAR])


def mouth_frame(skin: Skin, vertices: Floats, band_width: float) -> MouthFrame:
    """Return the frame of the inside of the mouth behind the lips of a head.

    Args:
        skin: Topology of the skin.
        vertices: The neutral skin in centimetres, shape (N, 3).
        band_width: Width of the base mesh's band of upper teeth in this head, in centimetres.
    """
    contact = vertices[skin.lip_contact]
    line = contact[np.abs(contact[:, 0]) < 0.5, 1].mean()
    inner = vertices[[skin.local(vertex) for vertex in _INNER_LIPS], 2].min()
    scale = band_width / _MAN_BAND
    return MouthFrame(np.array([0.0, line - _BELOW_LIPS * scale, inner - _BEHIND_LIPS * scale]), scale)


def tuck_lining(control: Floats, skin: Skin) -> Floats:
    """Return the skin's control mesh (N, 3) with the top of the mouth's lining lowered to the palate."""
    lining = np.unique(skin.quads[skin.in_mouth])
    line = control[skin.lip_contact, 1].mean()
    result = control.copy()
    above = np.maximum(control[lining, 1] - line - _LINING_FROM, 0.0)
    result[lining, 1] -= (1.0 - _LINING_FACTOR) * above
    result[lining, 2] -= _LINING_BACK * smooth(above / 0.9)
    return result


class JawMotion:
    """Motion of parts fixed to the lower jaw in the expression shapes.

    Attributes:
        hinge: Point of `jaw_hinge`, shape (3,).
        shifts: Translations of the jaw in jawForward, jawLeft and jawRight, in centimetres, shape (3,) each.
        shape_names: Names of all shapes, S of them.
    """

    def __init__(self, hinge: Floats, band_shapes: Floats, shape_names: Sequence[str]) -> None:
        """Take the shifts from the offsets of the base mesh's band of lower teeth, shape (S, n, 3)."""
        self.hinge, self.shape_names = hinge, tuple(shape_names)
        self.shifts = {name: band_shapes[self.shape_names.index(name)].mean(axis=0) for name in _JAW_SHIFTS}

    def still(self, points: Floats) -> Floats:
        """Return zero offsets for ``points`` (n, 3), shape (S, n, 3)."""
        return np.zeros((len(self.shape_names), *points.shape))

    def offsets(self, points: Floats, share: Floats | float = 1.0) -> Floats:
        """Return the offsets of ``points`` (n, 3), shape (S, n, 3).

        Args:
            points: Positions in centimetres, shape (n, 3).
            share: Share of the jaw's motion, for all points or for each, shape (n,).
        """
        result = self.still(points)
        each = np.broadcast_to(np.asarray(share, dtype=float), len(points))[:, None]
        result[self.shape_names.index("jawOpen")] = each * jaw_opening(points, self.hinge)
        for name, shift in self.shifts.items():
            result[self.shape_names.index(name)] = each * shift
        return result


def build_mouth(frame: MouthFrame, jaw: JawMotion) -> list[Piece]:
    """Return teeth and gums of both jaws, throat and tongue."""
    pieces = []
    for name, arch in (("upper", UPPER), ("lower", LOWER)):
        move = jaw.offsets if arch is LOWER else jaw.still
        pieces.append(mouth_piece(f"teeth_{name}", "teeth", build_crowns(arch, frame), move))
        pieces.append(mouth_piece(f"gums_{name}", "gums", build_gum(arch, frame), move))
    pieces.append(mouth_piece("throat", "gums", build_throat(frame), jaw.still))
    pieces.append(tongue_piece(frame, jaw))
    return pieces


def tongue_piece(frame: MouthFrame, jaw: JawMotion, rings: int = 24, around: int = 20) -> Piece:
    """Return the tongue, with ``rings`` from root to tip of ``around`` vertices each."""
    vertices, quads, uv, out, follow = build_tongue(frame, rings, around)
    shapes = jaw.offsets(vertices + _TONGUE_AHEAD * (out - vertices), follow)
    shapes[jaw.shape_names.index("tongueOut")] += out - vertices
    return Piece("tongue", "tongue", vertices, quads, uv, quads.copy(), shapes)


def mouth_piece(name: str, material: str, mesh: tuple[Floats, Ints, Floats], move: Callable[[Floats], Floats]) -> Piece:
    """Return the piece of ``mesh``: vertices, quads and texture coordinates, with the shapes given by ``move``."""
    vertices, quads, uv = mesh
    return Piece(name, material, vertices, quads, uv, quads.copy(), move(vertices))
