"""Plausible sizes, directions and places of a rig's displacements, by comparison with those of the built-in man."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import counted
from faceposer.geometry.alignment import Similarity
from faceposer.geometry.displacement_fields import edges_of, unevenness
from faceposer.model.character_file import load_character
from faceposer.model.shape_names import half_shapes_of, whole_shape_of
from faceposer.training.canonical_frame import mean_direction

Array = NDArray[np.float64]
Shapes = Mapping[str, NDArray[np.float32]]

# Units that are taken for each other differ by these factors, to which most shapes agree within the tolerance.
_UNITS = (10.0, 100.0, 1000.0, 0.1, 0.01, 0.001)
_TOLERANCE = 1.8
# Typical sizes that are not mentioned; and the largest one that is used. Sizes within the spread agree.
_USUAL = (0.4, 2.5)
_TOO_LARGE = 8.0
_SPREAD, _AGREE = 6.0, 0.6
# Sizes of one shape, relative to the others, that are mentioned; least size in centimetres of a large one.
_SMALL_SHAPE, _LARGE_SHAPE = 0.15, 3.6
_LARGE = 1.0
# Factor from which a single shape cannot be an expression, and least displacement of the man that is compared, in cm.
_IMPLAUSIBLE = 30.0
_LEAST = 0.2
# Coherence from which a shape has a direction, cosine of opposite directions, and distance in cm of another place.
_DIRECTED = 0.5
_OPPOSITE = -0.5
_ELSEWHERE = 4.5
# Share of the shapes that do not fit in a rig with other names.
_WRONG = 0.3
# Unevenness of a shape, and relative to the other shapes, that is mentioned; and of a rig in another vertex order, with
# the distance of its shapes from the man's in centimetres.
_UNEVEN, _MORE_UNEVEN = 0.3, 3.0
_ALL_UNEVEN, _FAR = 0.4, 1.5
_LISTED = 4


@dataclass(frozen=True)
class DisplacementCheck:
    """The plausibility of a rig's displacements.

    Attributes:
        factor: Number by which all displacements are to be multiplied; 1 for plausible ones.
        refusal: Clause that says why no expression of a face has them, with its remedy; "" if one has.
        notes: Sentences about the factor and about shapes that may be wrong.
    """

    factor: float = 1.0
    refusal: str = ""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Motion:
    """The motion of a shape: largest displacement in centimetres, mean direction, and place."""

    size: float
    direction: Array
    middle: Array


def check_displacements(
    named: Shapes, vertices: Array, polygons: NDArray[np.integer], upright: Similarity, correct: bool = True
) -> DisplacementCheck:
    """Compare the displacements of shapes with those of the built-in man.

    Args:
        named: Offsets, shape (N, 3), by ARKit's names of the side that they move.
        vertices: Vertices in the file's axes and unit, shape (N, 3).
        polygons: Vertex ids, shape (F, K), padded with -1.
        upright: Similarity from the file's axes and unit to the canonical frame.
        correct: False for offsets that are known to be in the unit of the face.
    """
    usual = _usual_motions()
    placed = upright.apply(vertices)
    motions = {
        name: _motion(upright.apply_to_directions(offsets), placed)
        for name, offsets in named.items()
        if name in usual and np.any(offsets)
    }
    ratios = {name: motion.size / usual[name].size for name, motion in motions.items() if usual[name].size >= _LEAST}
    if not ratios:
        return DisplacementCheck()
    factor, typical = _unit(np.array([*ratios.values()]), correct)
    notes = _unit_notes(factor, typical)
    largest = max(motions, key=lambda name: motions[name].size)
    size = factor * motions[largest].size
    if typical > _TOO_LARGE and correct:
        return DisplacementCheck(
            factor,
            f"its displacements are about {_plain(typical)} times those of a face ({largest} moves vertices by "
            f"{_plain(size)} cm); export it again with displacements in the unit of the neutral face",
        )
    if size > _IMPLAUSIBLE * max(usual[largest].size, 1.0):
        return DisplacementCheck(
            factor,
            f"its shape {largest} moves vertices by {_plain(size)} cm, "
            f"{_plain(ratios.get(largest, 0.0) * factor / typical)} times as far as the others would suggest; export "
            "it again in the unit of the neutral face",
        )
    opposite = _opposite(motions, usual)
    distances = {name: float(np.linalg.norm(motion.middle - usual[name].middle)) for name, motion in motions.items()}
    elsewhere = [name for name, distance in distances.items() if distance > _ELSEWHERE]
    edges = edges_of(polygons, vertices)
    uneven = {name: value for name, offsets in named.items() if (value := unevenness(offsets, edges)) > 0.0}
    median = float(np.median([*uneven.values()] or [0.0]))
    if median > _ALL_UNEVEN and float(np.median([*distances.values()])) > _FAR:
        return DisplacementCheck(
            factor,
            "in its shapes neighbouring vertices move in different directions, as with displacements in another vertex "
            "order than the mesh; export mesh and shapes together",
        )
    wrong = {*opposite, *elsewhere}
    if correct and len(wrong) >= max(3.0, _WRONG * len(motions)):
        return DisplacementCheck(
            factor,
            f"{len(wrong)} of its {len(motions)} shapes, such as {min(wrong)}, move another part of the face, or in "
            "another direction, than their names say; check that its names belong to these shapes",
        )
    notes += _shape_notes(opposite, elsewhere, ratios, factor / typical, motions)
    notes += _uneven_notes([name for name, value in uneven.items() if value > max(_UNEVEN, _MORE_UNEVEN * median)])
    return DisplacementCheck(factor, "", tuple(notes))


def _unit(ratios: Array, correct: bool) -> tuple[float, float]:
    """Return the factor that converts displacements to the unit of the face, and their typical size after it.

    Args:
        ratios: Sizes of the shapes relative to those of the man.
        correct: False to convert nothing.
    """
    typical = float(np.median(ratios))
    agree = float(((ratios > typical / _SPREAD) & (ratios < typical * _SPREAD)).mean())
    if agree < _AGREE:
        # Shapes of different units: those of a face are the reference.
        return 1.0, 1.0
    if correct and not _USUAL[0] <= typical <= _USUAL[1]:
        unit = next((unit for unit in _UNITS if 1.0 / _TOLERANCE < typical / unit < _TOLERANCE), 1.0)
        return 1.0 / unit, typical / unit
    return 1.0, typical


def _unit_notes(factor: float, typical: float) -> list[str]:
    """Return a sentence about the typical size of the displacements, if it is unusual."""
    if factor < 1.0:
        times = f"{1.0 / factor:g}"
        return [f"The displacements are about {times} times those of a face; they were divided by {times}."]
    if factor > 1.0:
        return [
            f"The displacements are about {1.0 / factor:g} times those of a face; they were multiplied by {factor:g}."
        ]
    if typical > _USUAL[1]:
        return [f"The shapes move the face about {_plain(typical)} times as far as usual; check their unit."]
    if typical < _USUAL[0]:
        return [f"The shapes move the face only about {_plain(typical)} times as far as usual; check their unit."]
    return []


def _shape_notes(
    opposite: list[str],
    elsewhere: list[str],
    ratios: Mapping[str, float],
    relative: float,
    motions: Mapping[str, _Motion],
) -> list[str]:
    """Return a sentence for each kind of implausible shape."""
    large = [n for n, ratio in ratios.items() if ratio * relative > _LARGE_SHAPE and motions[n].size > _LARGE]
    small = [n for n, ratio in ratios.items() if ratio * relative < _SMALL_SHAPE]
    kinds = (
        (opposite, "moves vertices against the usual direction", "move vertices against the usual direction"),
        (elsewhere, "moves another part of the face", "move another part of the face"),
        (large, "moves vertices much farther than the others", "move vertices much farther than the others"),
        (small, "hardly moves any vertex", "hardly move any vertex"),
    )
    notes = []
    for names, one, many in kinds:
        if len(names) == 1:
            detail = (
                f" ({_plain(ratios[names[0]] * relative)} times as far as usual)"
                if names[0] in (*large, *small)
                else ""
            )
            notes.append(f"The shape {names[0]} {one}{detail}; check it.")
        elif names:
            notes.append(f"{len(names)} shapes {many}: {_listed(names)}; check them.")
    return notes


def _uneven_notes(uneven: list[str]) -> list[str]:
    """Return a sentence about shapes in which neighbouring vertices move in unrelated directions."""
    if not uneven:
        return []
    verb = "moves" if len(uneven) == 1 else "move"
    return [
        f"{counted(len(uneven), 'shape')} ({_listed(uneven)}) {verb} neighbouring vertices in different directions, "
        "as with noise, or with vertices in another order; check the mesh."
    ]


def _listed(names: list[str]) -> str:
    rest = len(names) - _LISTED
    return ", ".join(names[:_LISTED]) + (f" and {rest} more" if rest > 0 else "")


def _plain(number: float) -> str:
    """Return ``number`` with two digits, without an exponent for large ones."""
    return f"{number:.2g}" if number < 10.0 else f"{number:.0f}"


def _opposite(motions: Mapping[str, _Motion], usual: Mapping[str, _Motion]) -> list[str]:
    """Return the shapes with the opposite direction of the man's."""
    found = []
    for name, motion in motions.items():
        ours, theirs = motion.direction, usual[name].direction
        if _is_directed(motion, usual[name]):
            cosine = float(ours @ theirs) / float(np.linalg.norm(ours) * np.linalg.norm(theirs))
            if cosine < _OPPOSITE:
                found.append(name)
    return found


def _is_directed(motion: _Motion, usual: _Motion) -> bool:
    return min(float(np.linalg.norm(m.direction)) for m in (motion, usual)) > _DIRECTED


def _motion(offsets: Array, placed: Array) -> _Motion:
    squares = np.einsum("nd,nd->n", offsets, offsets)
    total = max(float(squares.sum()), np.finfo(float).tiny)
    return _Motion(float(np.sqrt(squares.max(initial=0.0))), mean_direction(offsets), squares @ placed / total)


@lru_cache(maxsize=1)
def _usual_motions() -> dict[str, _Motion]:
    """Return the motion of each of the man's shapes."""
    man = load_character("man")
    placed = man.vertices.astype(np.float64)
    shapes = dict(zip(man.shape_names, man.shapes.astype(np.float64), strict=True))
    halves = {whole_shape_of(name): half_shapes_of(whole_shape_of(name)) for name in shapes}
    shapes |= {whole: sum(shapes[half] for half in pair) for whole, pair in halves.items() if pair}
    return {name: _motion(shape, placed) for name, shape in shapes.items() if np.any(shape)}
