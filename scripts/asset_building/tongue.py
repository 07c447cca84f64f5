"""The tongue: at rest in the floor of the mouth, and stuck out between the lips."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from scripts.asset_building.dental_arch import MouthFrame, smooth
from scripts.asset_building.piece import Floats, Ints, grid_quads


@dataclass(frozen=True)
class _Form:
    """Outline of the tongue at some places from root (0) to tip (1): all in centimetres of a man."""

    at: tuple[float, ...]
    back: tuple[float, ...]
    top: tuple[float, ...]
    bottom: tuple[float, ...]
    half_width: tuple[float, ...]

    def __call__(self, t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        return tuple(PchipInterpolator(self.at, values)(t) for values in self._rows)  # type: ignore[return-value]

    @property
    def _rows(self) -> tuple[tuple[float, ...], ...]:
        return self.back, self.top, self.bottom, self.half_width


_REST = _Form(
    at=(0.0, 0.14, 0.32, 0.52, 0.70, 0.84, 0.94, 1.0),
    back=(6.3, 5.8, 4.8, 3.6, 2.5, 1.70, 1.22, 1.00),
    top=(-2.4, -1.15, -0.42, -0.10, -0.04, -0.05, -0.12, -0.24),
    bottom=(-3.4, -3.0, -2.3, -1.9, -1.50, -0.92, -0.58, -0.46),
    half_width=(1.6, 1.95, 2.15, 2.10, 1.74, 1.30, 0.84, 0.30),
)
_OUT = _Form(
    at=(0.0, 0.14, 0.32, 0.52, 0.70, 0.84, 0.94, 1.0),
    back=(6.2, 5.5, 4.0, 2.1, 0.2, -1.35, -2.25, -2.62),
    top=(-2.4, -1.05, 0.0, 0.62, 0.74, 0.80, 0.70, 0.46),
    bottom=(-3.4, -3.0, -2.0, -0.75, 0.10, 0.26, 0.28, 0.28),
    half_width=(1.6, 1.95, 2.1, 1.80, 1.40, 1.26, 0.96, 0.38),
)


def build_tongue(frame: MouthFrame, rings: int, around: int) -> tuple[Floats, Ints, Floats, Floats, Floats]:
    """Return the tongue.

    Returns:
        Vertices (n, 3), quads (f, 4), texture coordinates (n, 2), the vertices with the tongue stuck out (n, 3), and
        how far each vertex goes with the jaw, 1 in front and less towards the root, (n,).
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
    # From above: u across, v from the root to the tip; the underside is folded onto the same place, darker below.
    side = 0.5 + 0.23 * np.cos(angle)
    upper = np.sin(angle) > -0.35
    u = np.concatenate([np.tile(np.where(upper, side, 0.5 + 0.46 * np.sign(np.cos(angle))), rings), [0.5, 0.5]])
    uv = np.stack([u, np.concatenate([0.03 + 0.94 * np.repeat(t, around), [0.01, 0.99]])], axis=1)
    return rest, quads, uv, out, follow


def _vertices(form: _Form, t: Floats, angle: Floats, frame: MouthFrame) -> Floats:
    back, top, bottom, half = (values[:, None] for values in form(t))
    cosine, sine = np.cos(angle)[None, :], np.sin(angle)[None, :]
    across = half * np.sign(cosine) * np.abs(cosine) ** 0.85
    middle, rise = 0.5 * (top + bottom), 0.5 * (top - bottom)
    # Flat above, like a boat's hull below.
    up = middle + rise * np.where(sine > 0.0, np.abs(sine) ** 0.8, -(np.abs(sine) ** 1.15))
    groove = 0.10 * np.exp(-((across / 0.22) ** 2)) * np.maximum(sine, 0.0) * smooth((t[:, None] - 0.2) / 0.3)
    groove = groove * (1.0 - 0.6 * smooth((t[:, None] - 0.8) / 0.2))
    points = frame.place(across, back + 0.0 * across, up - groove).reshape(-1, 3)
    # The ends are closed by a point each, the tip's a little ahead.
    root = points[: len(angle)].mean(axis=0)
    tip = points[-len(angle) :].mean(axis=0)
    ahead = points[-len(angle) :].mean(axis=0) - points[-2 * len(angle) : -len(angle)].mean(axis=0)
    return np.concatenate([points, [root, tip + 0.45 * ahead]])
