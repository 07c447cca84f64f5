"""Crowns of teeth: incisors, canines, premolars and molars, in contact with their neighbours."""

import numpy as np
from scipy.interpolate import PchipInterpolator

from scripts.asset_building.dental_arch import (
    CANINE,
    MOLAR,
    N_KINDS,
    PREMOLAR,
    Arch,
    MouthFrame,
    smooth,
)
from scripts.asset_building.piece import Floats, Ints, grid_quads

#: Levels of the rings of a crown as shares of its length from the edge, the last one inside the gum.
_LEVELS = np.array([1.18, 0.92, 0.68, 0.46, 0.26, 0.10, 0.0])
#: Rings on the biting surface, as shares of the outline.
_CAP = np.array([0.70, 0.34])
#: Vertices around a crown.
AROUND = 14
#: Factor on the measured width of the crowns, so that they touch along a curve.
_CONTACT = 1.015
#: Levels of the knots of the profiles below.
_KNOTS = np.array([0.0, 0.12, 0.3, 0.5, 0.75, 1.0, 1.2])
#: Half the width of the crown as a share of the widest, between edge and neck, whose own share is the last but one.
_WIDTHS = {
    "incisor": (0.93, 0.985, 1.0, 0.995, 0.965),
    "canine": (0.80, 0.92, 1.0, 0.995, 0.955),
    "premolar": (0.84, 0.95, 1.0, 0.995, 0.955),
    "molar": (0.86, 0.96, 1.0, 0.985, 0.92),
}
#: Thickness of the crown from its face inwards, as a share of its depth.
_THICKNESS = {
    "incisor": (0.15, 0.22, 0.34, 0.56, 0.92, 0.88, 0.80),
    "canine": (0.20, 0.32, 0.52, 0.74, 0.98, 0.92, 0.84),
    "premolar": (0.76, 0.88, 0.97, 1.0, 0.97, 0.89, 0.82),
    "molar": (0.80, 0.91, 0.99, 1.0, 0.97, 0.91, 0.85),
}
#: Depth of the face of the crown behind its most prominent point, in centimetres.
_FACE = {
    "incisor": (0.075, 0.035, 0.008, 0.0, 0.008, 0.045, 0.08),
    "canine": (0.14, 0.085, 0.03, 0.0, 0.0, 0.045, 0.09),
    "premolar": (0.13, 0.085, 0.035, 0.0, 0.0, 0.05, 0.10),
    "molar": (0.15, 0.10, 0.05, 0.015, 0.0, 0.045, 0.09),
}
#: Exponent of the outline's superellipse.
_OUTLINE = {"incisor": 3.2, "canine": 2.8, "premolar": 2.8, "molar": 3.2}


def kind_name(kind: int) -> str:
    """Return "incisor", "canine", "premolar" or "molar"."""
    return "incisor" if kind < CANINE else "canine" if kind < PREMOLAR else "premolar" if kind < MOLAR else "molar"


class CrownShape:
    """Shape of the crowns of one kind in one jaw, left of the middle.

    Coordinates are the height from the edge as a share of the length, and the positions towards the back of the jaw (u)
    and towards the face (v), each from -1 to 1.
    """

    def __init__(self, arch: Arch, kind: int) -> None:
        """Compute the profiles of ``kind`` in the jaw of ``arch``."""
        self.arch, self.kind, self.name = arch, kind, kind_name(kind)
        self.length, self.depth = float(arch.length[kind]), float(arch.depth[kind])
        neck = arch.neck[kind]
        self._half = PchipInterpolator(_KNOTS, 0.5 * arch.width[kind] * np.array([*_WIDTHS[self.name], neck, neck]))
        self._thickness = PchipInterpolator(_KNOTS, self.depth * np.array(_THICKNESS[self.name]))
        self._face = PchipInterpolator(_KNOTS, np.array(_FACE[self.name]))
        self._lean = np.tan(np.deg2rad(arch.inclination[kind]))
        # Incisors stand on the arch with their edges, other teeth with their middle.
        edge = 0.0 if self.name in ("incisor", "canine") else 0.45
        self._forward = float(self._face(edge) + 0.5 * self._thickness(edge) + self._lean * edge * self.length)

    def half_width(self, level: Floats) -> Floats:
        """Return half the mesiodistal diameter at ``level``."""
        return np.asarray(self._half(level))

    def outward(self, level: Floats, v: Floats) -> Floats:
        """Return the distance outside the arch's line of ``v`` at ``level``: 1 is the face, -1 the back."""
        face = self._forward - self._face(level) - self._lean * level * self.length
        outward: Floats = face - 0.5 * (1.0 - v) * self._thickness(level)
        return outward

    def outline(self, angle: Floats) -> tuple[Floats, Floats]:
        """Return u and v of the outline at ``angle`` from the back of the jaw towards the face."""
        power = 2.0 / _OUTLINE[self.name]
        cosine, sine = np.cos(angle), np.sin(angle)
        return np.sign(cosine) * np.abs(cosine) ** power, np.sign(sine) * np.abs(sine) ** power

    def face_at(self, u: Floats) -> Floats:
        """Return v of the outline's outer side at ``u``."""
        power = _OUTLINE[self.name]
        result: Floats = np.maximum(1.0 - np.abs(u) ** power, 0.0) ** (1.0 / power)
        return result

    def drawn_face_at(self, u: Floats, around: int = AROUND) -> Floats:
        """Return v of the outer side at ``u`` of the polygon with ``around`` corners that is drawn for the outline."""
        angle = (np.arange(around // 2) + 0.5) * (2.0 * np.pi / around)
        at, v = self.outline(angle)
        return np.asarray(np.interp(u, at[::-1], v[::-1]))

    def relief(self, u: Floats, v: Floats) -> Floats:
        """Return the depth of the biting surface behind the tips of the crown, in centimetres."""
        far, near = np.maximum(u, 0.0), np.maximum(-u, 0.0)
        if self.kind == 0:
            return 0.035 * far**3 + 0.06 * far**9 + 0.03 * near**9
        if self.name == "incisor":
            lower = 0.5 if self.arch.up < 0 else 1.0
            return lower * (0.09 * far**3 + 0.05 * far**9 + 0.02 * near**3 + 0.04 * near**9)
        if self.name == "canine":
            return 0.16 * far**1.4 + 0.12 * near**1.4
        if self.name == "premolar":
            lingual = (0.10 if self.arch.up > 0 else 0.22) * smooth(0.5 - 1.2 * v)
            groove = 0.15 * np.exp(-(((v + 0.05) / 0.30) ** 2)) * (1.0 - 0.5 * u * u)
            return lingual + groove + 0.13 * np.abs(u) ** 1.5
        groove = 0.13 * np.exp(-((v / 0.28) ** 2)) * (1.0 - 0.55 * u**4)
        across = 0.085 * np.exp(-(((u - 0.05) / 0.22) ** 2))
        result: Floats = groove + across + 0.05 * u**4 + 0.03 * far
        return result


def build_crowns(arch: Arch, frame: MouthFrame, around: int = AROUND) -> tuple[Floats, Ints, Floats]:
    """Return the fourteen crowns of a jaw: vertices (n, 3), quads (f, 4) and texture coordinates (n, 2).

    u of the texture runs around the crown, with a column for each kind of tooth, upper and lower ones side by side;
    v runs from the root to the middle of the biting surface.
    """
    angle = (np.arange(around) + 0.5) * (2.0 * np.pi / around)
    points, quads, uvs = [], [], []
    for kind in range(N_KINDS):
        shape = CrownShape(arch, kind)
        middle = 0.5 * (arch.edges[kind] + arch.edges[kind + 1])
        u, outward, height = _crown(shape, angle)
        half = shape.half_width(np.concatenate([np.repeat(_LEVELS, around), np.zeros(len(u) - around * len(_LEVELS))]))
        level = np.concatenate(
            [
                np.repeat(np.linspace(0.0, 0.74, len(_LEVELS)), around),
                np.repeat(1.0 - 0.26 * _CAP, around),
                [1.0],
            ]
        )
        turn = np.append(np.tile((np.arange(around) + 0.5) / around, len(_LEVELS) + len(_CAP)), 0.5)
        column = 2 * kind + (arch.up < 0)
        uv = np.stack([(column + 0.08 + 0.84 * turn) / (2 * N_KINDS), 0.02 + 0.96 * level], axis=-1)
        for side in (1, -1):
            at, normal = arch.at(np.array(side * middle))
            tangent = np.array([-normal[1], normal[0]])
            place = at + np.outer(side * _CONTACT * u * half, tangent) + np.outer(outward, normal)
            crown = frame.place(place[:, 0], place[:, 1], arch.up * (arch.tip[kind] + height))
            # A ring runs one way on the left and the other way on the right, above and below.
            faces = _crown_quads(around)[:, :: side * arch.up]
            quads.append(faces + sum(map(len, points)))
            points.append(crown)
            uvs.append(uv)
    return np.concatenate(points), np.concatenate(quads).astype(np.int32), np.concatenate(uvs)


def _crown(shape: CrownShape, angle: Floats) -> tuple[Floats, Floats, Floats]:
    """Return u, the distance outside the arch's line and the height from the edge of a crown's vertices, each (n,)."""
    ring_u, ring_v = shape.outline(angle)
    us, outs, heights = [], [], []
    for level in _LEVELS:
        # The relief of the edge fades out towards the neck.
        rise = shape.relief(ring_u, ring_v) * (1.0 - smooth(np.array(level / 0.9)))
        us.append(ring_u)
        outs.append(shape.outward(np.full_like(ring_v, level), ring_v))
        heights.append(level * shape.length + rise)
    for radius in (*_CAP, 0.0):
        u, v = (radius * ring_u, radius * ring_v) if radius else (np.zeros(1), np.zeros(1))
        us.append(u)
        outs.append(shape.outward(np.zeros_like(v), v))
        # The cap of a thin edge is rounded.
        round_off = 0.012 * (1.0 - radius**2) if shape.name in ("incisor", "canine") else 0.0
        heights.append(shape.relief(u, v) - round_off)
    return np.concatenate(us), np.concatenate(outs), np.concatenate(heights)


def _crown_quads(around: int) -> Ints:
    rings = len(_LEVELS) + len(_CAP)
    last, centre = (rings - 1) * around, rings * around
    even = np.arange(0, around, 2)
    fan = np.stack(
        [np.full_like(even, centre), last + even, last + even + 1, last + (even + 2) % around],
        axis=-1,
    )
    return np.concatenate([grid_quads(rings, around, closed=True), fan]).astype(np.int32)
