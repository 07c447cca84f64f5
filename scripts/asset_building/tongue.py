"""The tongue: at rest on the floor of the mouth, and stuck out between the lips."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from scripts.asset_building.dental_arch import MouthFrame, smooth
from scripts.asset_building.piece import Floats, Ints, grid_quads


@dataclass(frozen=True)
class _Form:
    """Sections of the tongue at positions from root (0) to tip (1), in centimetres of a man and degrees.

    Attributes:
        at: Positions of the sections.
        back, up: Middles of the sections.
        rise: Half of their height.
        half_width: Half of their width.
        lean: Forward lean of their upper ends.
        drop: Drop of the tongue's sides over the lip, per square centimetre.
    """

    at: tuple[float, ...]
    back: tuple[float, ...]
    up: tuple[float, ...]
    rise: tuple[float, ...]
    half_width: tuple[float, ...]
    lean: tuple[float, ...]
    drop: tuple[float, ...]

    def __call__(self, t: Floats) -> Floats:
        """Return back, up, rise, half width, lean in radians and drop at ``t`` (n,), shape (6, n)."""
        rows = (self.back, self.up, self.rise, self.half_width, np.deg2rad(self.lean), self.drop)
        return np.stack([PchipInterpolator(self.at, row)(t) for row in rows])


_REST = _Form(
    at=(0.0, 0.14, 0.32, 0.52, 0.70, 0.84, 0.94, 1.0),
    back=(6.3, 5.8, 4.8, 3.6, 2.5, 1.70, 1.22, 1.00),
    up=(-2.9, -2.075, -1.36, -1.0, -0.62, 0.0, 0.28, 0.35),
    rise=(0.5, 0.925, 0.94, 0.9, 0.68, 0.30, 0.16, 0.08),
    half_width=(1.6, 1.95, 2.15, 2.10, 1.68, 1.18, 0.78, 0.30),
    lean=(0.0,) * 8,
    drop=(0.0,) * 8,
)
#: Over the lower teeth and on the lower lip.
_OUT = _Form(
    at=(0.0, 0.14, 0.32, 0.50, 0.64, 0.74, 0.82, 0.88, 0.93, 0.965, 0.988, 1.0),
    back=(6.2, 5.5, 4.0, 2.2, 0.95, 0.25, -0.45, -1.10, -1.62, -1.93, -2.10, -2.17),
    up=(-2.9, -2.05, -1.0, -0.07, 0.36, 0.50, 0.20, -0.06, 0.0, -0.05, -0.24, -0.38),
    rise=(0.5, 1.0, 1.0, 0.66, 0.42, 0.32, 0.36, 0.42, 0.36, 0.27, 0.19, 0.10),
    half_width=(1.6, 1.95, 2.1, 1.80, 1.46, 1.30, 1.22, 1.20, 1.13, 0.95, 0.64, 0.28),
    lean=(0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 9.0, 20.0, 33.0, 45.0, 55.0, 60.0),
    drop=(0.0, 0.0, 0.0, 0.0, 0.0, 0.06, 0.14, 0.14, 0.12, 0.10, 0.10, 0.10),
)


def build_tongue(frame: MouthFrame, rings: int, around: int) -> tuple[Floats, Ints, Floats, Floats, Floats]:
    """Return the tongue.

    Returns:
        Vertices (n, 3), quads (f, 4), texture coordinates (n, 2), the vertices with the tongue stuck out (n, 3), and
        the share of the jaw's motion of each vertex, 1 in front and less towards the root, (n,).
    """
    # Rings are closer where the tip is round.
    t = 1.0 - (1.0 - np.linspace(0.0, 1.0, rings)) ** 1.5
    angle = np.arange(around) * (2.0 * np.pi / around)
    rest, out = (_vertices(form, t, angle, frame) for form in (_REST, _OUT))
    n = rings * around
    even = np.arange(0, around, 2)
    start = np.stack([np.full_like(even, n), (even + 2) % around, even + 1, even], axis=1)
    last = (rings - 1) * around
    end = np.stack([np.full_like(even, n + 1), last + even, last + even + 1, last + (even + 2) % around], axis=1)
    quads = np.concatenate([grid_quads(rings, around, closed=True), start, end]).astype(np.int32)
    share = np.concatenate([np.repeat(smooth(t / 0.4), around), [0.0, 1.0]])
    follow = 0.72 + 0.28 * share
    # u from the middle of the back, 0.5, around either side to the middle below; v from the root to the tip.
    around_top = np.abs((angle - 0.5 * np.pi + np.pi) % (2.0 * np.pi) - np.pi) / np.pi
    u = np.concatenate([np.tile(0.5 + 0.46 * around_top, rings), [0.5, 0.7]])
    uv = np.stack([u, np.concatenate([0.03 + 0.94 * np.repeat(t, around), [0.01, 0.99]])], axis=1)
    return rest, quads, uv, out, follow


def _vertices(form: _Form, t: Floats, angle: Floats, frame: MouthFrame) -> Floats:
    back, middle, rise, half, lean, drop = (values[:, None] for values in form(t))
    cosine, sine = np.cos(angle)[None, :], np.sin(angle)[None, :]
    across = half * np.sign(cosine) * np.abs(cosine) ** 0.85
    # Flat above, rounded like a hull below.
    up = rise * np.where(sine > 0.0, np.abs(sine) ** 0.8, -(np.abs(sine) ** 1.15))
    groove = 0.10 * np.exp(-((across / 0.22) ** 2)) * np.maximum(sine, 0.0) * smooth((t[:, None] - 0.2) / 0.3)
    up = up - groove * (1.0 - smooth((t[:, None] - 0.75) / 0.2)) - drop * across**2
    points = frame.place(across, back - np.sin(lean) * up, middle + np.cos(lean) * up).reshape(-1, 3)
    # Each end is closed by a point, that of the tip slightly in front.
    root = points[: len(angle)].mean(axis=0)
    tip = points[-len(angle) :].mean(axis=0)
    ahead = tip - points[-2 * len(angle) : -len(angle)].mean(axis=0)
    return np.concatenate([points, [root, tip + 0.2 * ahead]])
