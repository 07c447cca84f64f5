"""Measures of human teeth and dental arches, and the resulting positions of teeth in a head.

- Crowns: mean lengths and diameters of permanent teeth as Wheeler gives them (Nelson and Ash, "Wheeler's Dental
  Anatomy, Physiology and Occlusion", 9th ed., 2010, chapters 6 to 12).
- Arch form: y = A x^6 + B x^2, the polynomial nearest to the beta function of Braun, Hnat, Fender and Legan ("The form
  of the human dental arch", Angle Orthodontist 68, 1998), by Noroozi, Hosseinzadeh Nik and Saeeda ("The dental arch
  form revisited", Angle Orthodontist 71, 2001). A and B are such that the crowns of one side fill the arch and the tips
  of the upper canines are as far apart as Woelfel, Igarashi and Dong measured on 316 adults (34.8 mm; Journal of
  Advanced Prosthodontics 6, 2014). Intercanine and intermolar widths then are 34 and 54 mm above, 26 and 49 mm below.
- Inclination of the crowns' faces: Andrews, "The six keys to normal occlusion", American Journal of Orthodontics 62,
  1972.
- Overbite and overjet of a normal occlusion: 2 to 3 mm.
- The plane of the bite is parallel to the line from the wing of the nose to the tragus and 3 cm below it (Woelfel et
  al.), so that it rises backwards.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scripts.asset_building.piece import Floats

#: Kinds of teeth from the middle backwards.
INCISOR, LATERAL, CANINE, PREMOLAR, SECOND_PREMOLAR, MOLAR, SECOND_MOLAR = range(7)
N_KINDS = 7
#: Overjet and overbite of the incisors, in centimetres.
OVERJET, OVERBITE = 0.30, 0.22
#: Slope of the plane of the bite towards the back, in degrees.
_TILT = 8.0


@dataclass(frozen=True)
class Arch:
    """Teeth of one jaw and the line of the arch, in centimetres of a man.

    Attributes:
        up: +1 if the crowns grow upwards from the bite (upper jaw), else -1.
        sixth, second: The coefficients A and B of the arch's form.
        setback: Distance of the beginning of the line behind the edges of the upper incisors.
        width: Mesiodistal diameters of the crowns from the middle backwards, shape (7,).
        length: Lengths of the crowns, from the neck to the edge, shape (7,).
        depth: Labiolingual diameters, shape (7,).
        neck: Mesiodistal diameter at the neck as a share of the width, shape (7,).
        tip: Distances of the edges from the plane of the bite, positive towards the roots, shape (7,).
        inclination: Inclination of the crowns' faces in degrees, positive if the neck is inside the edge, shape (7,).
    """

    up: int
    sixth: float
    second: float
    setback: float
    width: Floats
    length: Floats
    depth: Floats
    neck: Floats
    tip: Floats
    inclination: Floats

    @property
    def edges(self) -> Floats:
        """Lengths along the arch at which the crowns of one side begin and end, shape (8,)."""
        return np.concatenate([[0.0], np.cumsum(self.width)])

    def at(self, length: Floats) -> tuple[Floats, Floats]:
        """Return the positions on the line at signed ``length`` from the middle, and the outward normals.

        Both have shape (..., 2): to the left, and backwards.
        """
        x = np.linspace(-3.6, 3.6, 4001)
        run = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(self._back(x))))])
        run -= run[2000]
        at = np.interp(length, run, x)
        slope = 6.0 * self.sixth * at**5 + 2.0 * self.second * at
        normal = np.stack([slope, -np.ones_like(slope)], axis=-1) / np.hypot(slope, 1.0)[..., None]
        return np.stack([at, self._back(at)], axis=-1), normal

    def _back(self, x: Floats) -> Floats:
        back: Floats = self.setback + self.sixth * x**6 + self.second * x**2
        return back


UPPER = Arch(
    up=1,
    sixth=0.0052,
    second=0.20,
    setback=0.0,
    width=np.array([0.85, 0.65, 0.75, 0.70, 0.70, 1.00, 0.90]),
    length=np.array([1.05, 0.90, 1.00, 0.85, 0.85, 0.75, 0.70]),
    depth=np.array([0.70, 0.60, 0.80, 0.90, 0.90, 1.10, 1.10]),
    neck=np.array([0.82, 0.77, 0.73, 0.71, 0.71, 0.80, 0.78]),
    tip=np.array([0.00, 0.06, 0.00, 0.05, 0.06, 0.07, 0.09]),
    inclination=np.array([7.0, 3.0, -5.0, -7.0, -7.0, -9.0, -9.0]),
)
LOWER = Arch(
    up=-1,
    sixth=0.0078,
    second=0.24,
    setback=OVERJET,
    width=np.array([0.50, 0.55, 0.70, 0.70, 0.70, 1.10, 1.05]),
    length=np.array([0.90, 0.95, 1.10, 0.85, 0.80, 0.75, 0.70]),
    depth=np.array([0.60, 0.65, 0.75, 0.75, 0.80, 1.05, 1.00]),
    neck=np.array([0.70, 0.73, 0.79, 0.71, 0.71, 0.82, 0.76]),
    tip=np.array([-OVERBITE, -OVERBITE, -0.20, -0.01, 0.0, 0.01, 0.0]),
    inclination=np.array([-1.0, -1.0, -9.0, -14.0, -17.0, -20.0, -22.0]),
)


@dataclass(frozen=True)
class MouthFrame:
    """Frame of the inside of the mouth in a head: the midpoint of the upper incisors' edges, and its size.

    Attributes:
        origin: Shape (3,), in centimetres.
        scale: Size relative to that of a man.
        width: Additional factor on the width.
    """

    origin: Floats
    scale: float
    width: float = 1.0

    def place(self, across: Floats, back: Floats, up: Floats) -> Floats:
        """Return positions, shape (..., 3), for coordinates to the left, back and up, in centimetres of a man."""
        tilt = np.deg2rad(_TILT)
        along = np.array([0.0, np.sin(tilt), -np.cos(tilt)])
        normal = np.array([0.0, np.cos(tilt), np.sin(tilt)])
        across, back, up = np.broadcast_arrays(across, back, up)
        offset = np.multiply.outer(back, along) + np.multiply.outer(up, normal)
        offset[..., 0] = self.width * across
        placed: Floats = self.origin + self.scale * offset
        return placed


def smooth(t: Floats | NDArray[np.float64]) -> Floats:
    """Return the cubic step from 0 at ``t`` = 0 to 1 at ``t`` = 1."""
    t = np.clip(t, 0.0, 1.0)
    result: Floats = t * t * (3.0 - 2.0 * t)
    return result
