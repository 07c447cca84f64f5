"""Strokes of one feature: pieces of it add up, and a stroke replaces what it is drawn over."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from faceposer.model.feature_curves import FEATURES
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.constraints.sketch import SketchConstraint, TracedSketch
from faceposer.solve.constraints.stroke import as_pixels
from faceposer.solve.term import Array, Indices

#: Two adjacent feature points of a chain.
Edge = frozenset[str]

# Share of a sketch that a later one must cover to replace it.
_REPLACED = 0.5
# Number of edges of a component from which a sketch of an outline shows it.
_SHOWN = 0.5


def combined(constraints: Sequence[Constraint], sketch: SketchConstraint) -> tuple[Constraint, ...]:
    """Return ``constraints`` with the new ``sketch`` at the end.

    An earlier sketch is removed if the new one covers more than half of it, from whatever view; of an outline or a line
    along the mouth, the components are considered one by one, so that a lip replaces half of the mouth's outline.
    Sketches of other parts of the same feature remain beside the new one, and so do locked and disabled ones.

    Args:
        constraints: Constraints; sketches are resolved.
        sketch: The new sketch, resolved; the last of the returned constraints is this object.
    """
    new = covered_edges(sketch)
    kept: list[Constraint] = []
    for constraint in constraints:
        if not isinstance(constraint, SketchConstraint) or constraint.locked or not constraint.enabled:
            kept.append(constraint)
            continue
        whole = constraint.feature == sketch.feature or not FEATURES[constraint.feature].components
        parts = (constraint,) if whole else components_of(constraint)
        remaining = [part for part in parts if overlap(covered_edges(part), new) <= _REPLACED]
        kept += [constraint] if len(remaining) == len(parts) else remaining
    return (*kept, sketch)


def covered_edges(sketch: SketchConstraint) -> dict[Edge, float]:
    """Return the share of each edge of its feature that ``sketch``, which is resolved, covers."""
    feature, traced = FEATURES[sketch.feature], sketch.on_face
    shares: dict[Edge, float] = {}
    for i, chain in enumerate(feature.chains):
        at = traced.parameters[traced.chains == i]
        names = (*chain, chain[0]) if feature.closed else chain
        if feature.closed and 0.0 in at:
            at = np.append(at, len(chain))
        for j, edge in enumerate(pairwise(names)):
            within = at[(at >= j - 1e-9) & (at <= j + 1 + 1e-9)]
            share = float(np.ptp(within)) if len(within) else 0.0
            if share > 0.0:
                shares[frozenset(edge)] = min(share, 1.0)
    return shares


def overlap(old: Mapping[Edge, float], new: Mapping[Edge, float]) -> float:
    """Return the share of ``old`` that ``new`` covers, from 0 to 1."""
    total = sum(old.values())
    return sum(min(share, new.get(edge, 0.0)) for edge, share in old.items()) / total if total > 0.0 else 0.0


def components_of(sketch: SketchConstraint) -> tuple[SketchConstraint, ...]:
    """Return ``sketch`` of an outline or of the line along the mouth as sketches of its components, resolved alike.

    Their strokes are the parts of its stroke that correspond to them. Components that it does not show are left out.
    """
    traced, places = sketch.on_face, dict(sketch.matched)
    found = []
    for component in (FEATURES[name] for name in FEATURES[sketch.feature].components):
        (names,) = component.chains
        matched = tuple((name, places[name]) for name in names if name in places)
        chosen, parameters = _points_between(sketch, names)
        targets = traced.targets[chosen]
        if not matched or not len(chosen) or not np.ptp(targets, axis=0).any():
            continue
        part = TracedSketch(
            traced.points.subset(chosen),
            targets,
            traced.tangents[chosen],
            traced.matched[chosen],
            np.zeros(len(chosen), dtype=np.intp),
            parameters,
        )
        stroke = as_pixels(targets)
        shown = replace(sketch, feature=component.name, stroke=stroke, matched=matched, traced=part)
        if sum(covered_edges(shown).values()) >= _SHOWN:
            found.append(shown)
    return tuple(found)


def _points_between(sketch: SketchConstraint, names: Sequence[str]) -> tuple[Indices, Array]:
    """Return the points of ``sketch`` between the feature points ``names``, in that order, and parameters among them.

    Returns:
        Indices, shape (m,), and parameters, i at the i-th name, shape (m,).
    """
    feature, traced = FEATURES[sketch.feature], sketch.on_face
    by_index: dict[int, float] = {}
    for i, edge in enumerate(pairwise(names)):
        for chain_index, chain in enumerate(feature.chains):
            around = (*chain, chain[0]) if feature.closed else chain
            for j, other in enumerate(pairwise(around)):
                if set(other) != set(edge):
                    continue
                share = traced.parameters - j
                if feature.closed and j == len(chain) - 1:
                    # A closed curve ends at the parameter 0 of its first point.
                    share = np.where(traced.parameters == 0.0, 1.0, share)
                share = share if other == edge else 1.0 - share
                on_edge = (traced.chains == chain_index) & (share >= -1e-9) & (share <= 1.0 + 1e-9)
                by_index |= {k: i + float(share[k]) for k in np.flatnonzero(on_edge).tolist()}
    order = sorted(by_index, key=lambda k: by_index[k])
    return np.array(order, dtype=np.intp), np.array([by_index[k] for k in order], dtype=np.float64)
