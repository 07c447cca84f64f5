"""Plausible sizes of a rig's displacements, by comparison with those of the built-in man."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from faceposer.model.character_file import load_character

# Displacements of most shapes that are larger or smaller than the man's by these factors are in another unit.
_TOO_LARGE, _TOO_SMALL = 8.0, 0.05
# Units that are taken for each other differ by these factors; stylised faces exaggerate by up to the tolerance.
_UNITS = (100.0, 1000.0, 0.01, 0.001)
_TOLERANCE = 3.2
# Factor from which a single shape cannot be an expression, and least displacement of the man that is compared, in cm.
_IMPLAUSIBLE = 30.0
_LEAST = 0.2


@dataclass(frozen=True)
class DisplacementCheck:
    """The sizes of a rig's displacements.

    Attributes:
        factor: Power of ten by which all displacements are to be multiplied; 1 for plausible ones.
        implausible: Shape that is too large even then, or "".
        size: Its largest displacement in centimetres.
    """

    factor: float = 1.0
    implausible: str = ""
    size: float = 0.0

    @property
    def note(self) -> str:
        """Sentence about the factor; "" if it is 1."""
        if self.factor == 1.0:
            return ""
        inverse = 1.0 / self.factor
        if self.factor < 1.0:
            return f"The displacements are about {inverse:g} times those of a face and were divided by {inverse:g}."
        return f"The displacements are about {inverse:g} times those of a face and were multiplied by {self.factor:g}."


def check_displacements(
    named: Mapping[str, NDArray[np.float32]], centimetres: float, rescale: bool = True
) -> DisplacementCheck:
    """Compare the displacements of shapes with those of the built-in man.

    Args:
        named: Offsets, shape (N, 3), by ARKit's names.
        centimetres: Centimetres per unit of the offsets, from the size of the face.
        rescale: False for offsets that are known to be in the unit of the face.
    """
    usual = _usual_sizes()
    sizes = {
        name: centimetres * float(np.linalg.norm(offsets, axis=1).max(initial=0.0)) for name, offsets in named.items()
    }
    ratios = [size / usual[name] for name, size in sizes.items() if size > 0.0 and usual.get(name, 0.0) >= _LEAST]
    if not ratios:
        return DisplacementCheck()
    typical = float(np.median(ratios))
    largest = max(sizes, key=lambda name: sizes[name])
    factor = 1.0
    if rescale and not _TOO_SMALL <= typical <= _TOO_LARGE:
        unit = next((unit for unit in _UNITS if 1.0 / _TOLERANCE < typical / unit < _TOLERANCE), None)
        if unit is None:
            return DisplacementCheck(1.0, largest, sizes[largest])
        factor = 1.0 / unit
    if factor * sizes[largest] > _IMPLAUSIBLE * max(usual.get(largest, 0.0), 1.0):
        return DisplacementCheck(factor, largest, factor * sizes[largest])
    return DisplacementCheck(factor)


@lru_cache(maxsize=1)
def _usual_sizes() -> dict[str, float]:
    """Return the largest displacement of each of the man's shapes in centimetres."""
    man = load_character("man")
    return {
        name: float(np.linalg.norm(shape, axis=1).max(initial=0.0))
        for name, shape in zip(man.shape_names, man.shapes, strict=True)
    }
