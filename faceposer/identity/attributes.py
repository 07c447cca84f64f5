"""Attributes of heads: measured on any head of the model's topology, and set without changing the others.

A measurement is a linear functional of the aligned skin. With the rows L of all of them, the covariance C of heads and
the held ones H (rows of L), the shortest change in the metric of C that changes one by u and no other held one is

    Δ = C Hᵀ (H C Hᵀ)⁻¹ u,

equation (3) of Blanz and Vetter (SIGGRAPH 1999) with further equations. The file has the columns of V = C Lᵀ; C
contains, besides the statistics, MakeHuman's directions and details, so that Δ may leave the span of the modes.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.alignment import Similarity, rigid_alignment
from faceposer.identity.companion_file import read_companion, unusable
from faceposer.identity.model import IdentityModel
from faceposer.identity.model_file import load_identity_model
from faceposer.identity.template import HeadTemplate
from faceposer.resources import asset_path

Array = NDArray[np.float64]

FORMAT, NOUN = "faceposer.attributes", "file of attributes"
#: Group of the attributes of the whole person; the others are distances in the face.
PERSON = "Person"
#: Attributes that add up to zero: shares of ethnicities relative to the average head.
ETHNICITIES = ("african", "asian", "caucasian")
ASYMMETRY = "asymmetry"
_ROUNDS, _EXACT = 6, 1e-5
#: Deviation, as a share of its range, that an attribute of the face may cause in others by default.
_SLACK = 0.025
#: Odd part of a head, in centimetres, below which it counts as symmetric.
_SYMMETRIC = 1e-4
_INVALID = (AttributeError, IndexError, KeyError, TypeError, ValueError)


@dataclass(frozen=True)
class Attribute:
    """One attribute.

    Attributes:
        name: Short name, such as "nose-length".
        group: Group of sliders, such as "Nose".
        title: Name of its slider.
        less: What its lower end means.
        more: What its upper end means.
        unit: Unit of the measurement, "cm" or empty.
        average: Measurement of the average head, whose value is 0.
        scale: Change of the measurement per unit of the value.
        limits: Least and greatest natural value.
        relative_to: Attribute to which it is in proportion, or empty.
    """

    name: str
    group: str
    title: str
    less: str
    more: str
    unit: str
    average: float
    scale: float
    limits: tuple[float, float]
    relative_to: str = ""

    def measurement(self, value: float) -> float:
        """Return the measurement in its unit at ``value``."""
        return self.average + self.scale * value


class HeadAttributes:
    """Measures attributes of heads and changes them; a head is a skin of the template, shape (N, 3)."""

    def __init__(
        self,
        attributes: Sequence[Attribute],
        functionals: ArrayLike,
        directions: ArrayLike,
        patterns: ArrayLike,
        mean: ArrayLike,
        weights: ArrayLike,
        template: HeadTemplate,
    ) -> None:
        """Prepare measurements.

        Args:
            attributes: The attributes, "asymmetry" last and "caucasian" next to last; K - 2 others.
            functionals: Rows of L on the first C vertices of the skin, shape (K - 2, C, 3).
            directions: Columns of V as offsets of control vertices, shape (K - 2, C, 3).
            patterns: Odd offsets of control vertices with which symmetric heads become asymmetric, shape (A, C, 3).
            mean: The average head, control vertices, shape (C, 3).
            weights: Share of each vertex in the alignment of heads, shape (C,).
            template: The topology.
        """
        self._attributes = {attribute.name: attribute for attribute in attributes}
        self.template = template
        self._weights = np.asarray(weights, dtype=np.float64)
        self._mean = np.asarray(mean, dtype=np.float64)
        c = self._c = len(self._mean)
        self._points = template.skin(self._mean)[:c]
        given = np.asarray(functionals, dtype=np.float64)
        self._linear = [attribute.name for attribute in attributes][: len(given)]
        self._rows = without_motion(given.reshape(len(given), -1), self._points, self._weights)
        self._directions = np.asarray(directions, dtype=np.float64)
        self._patterns = np.asarray(patterns, dtype=np.float64)
        smoothed = np.stack([template.skin(offsets)[:c] for offsets in self._directions])
        self._gram = self._rows @ smoothed.reshape(len(smoothed), -1).T
        self._scales = np.array([self._attributes[name].scale for name in self._linear])

    @property
    def attributes(self) -> tuple[Attribute, ...]:
        """All attributes, in the order of their groups."""
        return tuple(self._attributes.values())

    @property
    def alignment_weights(self) -> Array:
        """Share of each of the first C vertices of the skin in the alignment of heads, shape (C,)."""
        return self._weights

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all attributes; as ``keep`` of `changed`, they hold everything else exactly."""
        return tuple(self._attributes)

    def __getitem__(self, name: str) -> Attribute:
        """Return the attribute ``name``.

        Raises:
            FacePoserError: If there is none.
        """
        if name not in self._attributes:
            raise FacePoserError(f"There is no attribute '{name}'; attributes are {', '.join(self._attributes)}.")
        return self._attributes[name]

    def measure(self, skin: ArrayLike) -> dict[str, float]:
        """Return the value of each attribute of ``skin``, shape (N, 3), wherever it is in space."""
        points = self._checked(skin)
        aligned = self._alignment(points).apply(points)
        values = self._linear_values(aligned)
        result = dict(zip(self._linear, values.tolist(), strict=True))
        result[ETHNICITIES[2]] = -(result[ETHNICITIES[0]] + result[ETHNICITIES[1]])
        odd = self._odd_part(aligned)
        result[ASYMMETRY] = self._size(odd) / self._attributes[ASYMMETRY].scale
        return {name: result[name] for name in self._attributes}

    def changed(
        self, skin: ArrayLike, values: Mapping[str, float], keep: Collection[str] | None = None, seed: int = 0
    ) -> Array:
        """Return ``skin``, shape (N, 3), changed so that it measures ``values``.

        Args:
            skin: A head.
            values: Values by name of attribute. Of one ethnicity, the others make up for it in equal parts.
            keep: Attributes that are to keep their values besides. If None, attributes of the person keep each other,
                and the face changes with them; attributes of the face then keep all others within 8 % of their
                range, which takes less unlikely heads than to keep them exactly.
            seed: Pattern by which a symmetric head becomes asymmetric.

        Raises:
            FacePoserError: If there is no such attribute, or a value is not finite.
        """
        for name, value in values.items():
            self[name]
            if not np.isfinite(value):
                raise FacePoserError(f"The value of the attribute '{name}' must be a finite number, not {value}.")
        result = self._checked(skin)
        person = {name: value for name, value in values.items() if self._attributes[name].group == PERSON}
        face = {name: value for name, value in values.items() if name not in person}
        if keep is None:
            people = {attribute.name for attribute in self.attributes if attribute.group == PERSON}
            result = self._with_linear(result, person, people)
            if face:
                result = self._with_linear(result, values, set(self._attributes), _SLACK)
        else:
            result = self._with_linear(result, values, {self[name].name for name in keep})
        if ASYMMETRY in values:
            result = self._with_asymmetry(result, float(values[ASYMMETRY]), seed)
        return result

    def _with_linear(self, points: Array, values: Mapping[str, float], kept: set[str], slack: float = 0.0) -> Array:
        if any(name in ETHNICITIES for name in values):
            values = _with_ethnicities(values, self.measure(points))
        wanted = {name: float(values[name]) for name in self._linear if name in values}
        held = [k for k, name in enumerate(self._linear) if name in wanted or name in kept]
        if not wanted:
            return points
        first = self._linear_values(self._alignment(points).apply(points))
        target = np.array([wanted.get(self._linear[k], first[k]) for k in held])
        if slack > 0.0:
            free = np.array([self._linear[k] not in wanted for k in held])
            target = first[held] + self._loosely(held, target - first[held], slack * free)
        for _ in range(_ROUNDS):
            alignment = self._alignment(points)
            missing = target - self._linear_values(alignment.apply(points))[held]
            if np.abs(missing).max() < _EXACT:
                break
            amounts = np.linalg.solve(self._gram[np.ix_(held, held)], missing * self._scales[held])
            offsets = self.template.skin(np.tensordot(amounts, self._directions[held], 1))
            points = points + alignment.inverse().apply_to_directions(offsets)
        return points

    def _loosely(self, held: list[int], change: Array, slack: Array) -> Array:
        """Return the values' changes of the Δ that minimises Δᵀ C⁻¹ Δ + Σ ((change - wanted) / (slack · range))²."""
        scales = self._scales[held]
        gram = self._gram[np.ix_(held, held)] / np.outer(scales, scales)
        ranges = np.array([np.ptp(self._attributes[self._linear[k]].limits) for k in held])
        result: Array = gram @ np.linalg.solve(gram + np.diag((slack * ranges) ** 2), change)
        return result

    def _with_asymmetry(self, points: Array, value: float, seed: int) -> Array:
        alignment = self._alignment(points)
        aligned = alignment.apply(points)
        odd = self._odd_part(aligned)
        size, wanted = self._size(odd), value * self._attributes[ASYMMETRY].scale
        if size > _SYMMETRIC:
            change = (wanted / size - 1.0) * odd
        else:
            shares = np.random.default_rng(seed).standard_normal(len(self._patterns))
            pattern = self.template.skin(np.tensordot(shares, self._patterns, 1))
            change = wanted / self._size(pattern) * pattern
        return points + alignment.inverse().apply_to_directions(change)

    def _checked(self, skin: ArrayLike) -> Array:
        points = np.asarray(skin, dtype=np.float64)
        if points.shape != (self.template.n_skin, 3) or not np.isfinite(points).all():
            raise FacePoserError(
                f"A head must have {self.template.n_skin} finite positions, in the order of the built-in man's skin."
            )
        return points

    def _alignment(self, points: Array) -> Similarity:
        return rigid_alignment(points[: self._c], self._points, self._weights)

    def _linear_values(self, aligned: Array) -> Array:
        change = (aligned[: self._c] - self._points).ravel()
        values: Array = (self._rows @ change) / self._scales
        return values

    def _odd_part(self, aligned: Array) -> Array:
        mirrored = aligned[self.template.mirror] * [-1.0, 1.0, 1.0]
        # The average head is even up to rounding, so that all of it is the head's own.
        odd: Array = 0.5 * (aligned - mirrored)
        return odd

    def _size(self, odd: Array) -> float:
        squared = np.square(odd[: self._c]).sum(axis=1)
        return float(np.sqrt((self._weights * squared).sum() / self._weights.sum()))


@lru_cache(maxsize=1)
def load_attributes(path: Path | None = None, model: IdentityModel | None = None) -> HeadAttributes:
    """Return the attributes in ``path``, the shipped ones if None, for heads of ``model``, the shipped one if None.

    Raises:
        FacePoserError: If a file cannot be read, or does not fit the model.
    """
    path = path or asset_path("identity-attributes.npz")
    model = model or load_identity_model()
    if model.template is None:
        raise FacePoserError("The model of heads has no topology, so that attributes cannot be measured.")
    meta, members = read_companion(path, FORMAT, NOUN)
    try:
        attributes = [_attribute(entry) for entry in meta["attributes"]]
        arrays = [_dequantised(members, name) for name in ("functionals", "directions", "patterns")]
        weights = members["weights"].astype(np.float64)
        c = len(model.mean_vertices)
        shapes = [(len(attributes) - 2, c, 3)] * 2 + [(len(arrays[2]), c, 3)]
        if [array.shape for array in arrays] != shapes or weights.shape != (c,) or not weights.sum() > 0:
            raise ValueError("shapes")
        if [attribute.name for attribute in attributes[-2:]] != [ETHNICITIES[2], ASYMMETRY]:
            raise ValueError("names")
        functionals, directions, patterns = arrays
        return HeadAttributes(
            attributes, functionals, directions, patterns, model.mean_vertices, weights, model.template
        )
    except _INVALID as error:
        raise unusable(path, NOUN, "its arrays do not belong together") from error


def quantised(name: str, values: Array) -> dict[str, NDArray[Any]]:
    """Return ``values``, shape (K, ...), as 16-bit numbers with a step for each of the K, as members of a file."""
    steps = np.maximum(np.abs(values).reshape(len(values), -1).max(axis=1) / 32767.0, 1e-12).astype(np.float32)
    rounded = np.rint(values / steps.reshape(-1, *[1] * (values.ndim - 1)).astype(np.float64))
    return {name: rounded.astype(np.int16), f"{name}.steps": steps}


def _dequantised(members: Mapping[str, NDArray[Any]], name: str) -> Array:
    values, steps = members[name], members[f"{name}.steps"].astype(np.float64)
    result: Array = values * steps.reshape(-1, *[1] * (values.ndim - 1))
    return result


def _attribute(entry: Mapping[str, Any]) -> Attribute:
    low, high = (float(limit) for limit in entry["limits"])
    scale = float(entry["scale"])
    if not (low < high and scale > 0.0 and np.isfinite([low, high, scale, entry["average"]]).all()):
        raise ValueError("limits")
    name, group, title, less, more, unit = (
        str(entry[key]) for key in ("name", "group", "title", "less", "more", "unit")
    )
    average, relative_to = float(entry["average"]), str(entry.get("relative_to", ""))
    return Attribute(name, group, title, less, more, unit, average, scale, (low, high), relative_to)


def without_motion(rows: Array, points: Array, weights: Array) -> Array:
    """Return functionals ``rows`` (K, 3 C) of heads that are moved back first, to first order."""
    centred = points - np.average(points, axis=0, weights=weights)
    moves = [np.broadcast_to(axis, points.shape).ravel() for axis in np.eye(3)]
    turns = [np.cross(axis, centred).ravel() for axis in np.eye(3)]
    motion = np.stack(moves + turns, axis=1)
    share = np.repeat(weights, 3)[:, None]
    fit = np.linalg.solve(motion.T @ (share * motion), (share * motion).T)
    result: Array = rows - (rows @ motion) @ fit
    return result


def _with_ethnicities(values: Mapping[str, float], now: Mapping[str, float]) -> dict[str, float]:
    """Return ``values`` with all ethnicities, adding up to 0: as given, and the others as ``now`` but for a shift."""
    given = {name: float(values[name]) for name in ETHNICITIES if name in values}
    free = [name for name in ETHNICITIES if name not in given]
    shares = given | {name: now[name] for name in free}
    excess = sum(shares.values()) / len(free or given)
    return {**values, **shares, **{name: shares[name] - excess for name in free or given}}
