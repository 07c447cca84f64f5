"""Quality of shape models: compactness, generalization and specificity (Davies, "Learning shape", 2002).

All three are computed on a sample of the examples. Distances are root mean squares over vertices, in centimetres.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_BLOCKS = 8
_DRAWS = 200
_TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True)
class Curves:
    """The three measures as functions of the number of components.

    Attributes:
        components: Numbers of components, 1, 2, ..., shape (m,).
        compactness: Share of the energy in the components.
        generalization: Reconstruction error of held-out contiguous blocks of examples; empty for too few examples.
        specificity: Distance of faces drawn from a Gaussian over the components to the nearest example.
        neutral: Distance of the examples from the neutral face, for comparison.
    """

    components: tuple[int, ...]
    compactness: tuple[float, ...]
    generalization: tuple[float, ...]
    specificity: tuple[float, ...]
    neutral: float

    def as_json(self) -> dict[str, object]:
        """Return the JSON form of the curves."""
        return {
            "components": list(self.components),
            "compactness": [round(value, 6) for value in self.compactness],
            "generalization_cm": [round(value, 6) for value in self.generalization],
            "specificity_cm": [round(value, 6) for value in self.specificity],
            "neutral_cm": round(self.neutral, 6),
        }


def contiguous_blocks(count: int, most: int = _BLOCKS) -> list[NDArray[np.intp]]:
    """Split the numbers 0 to ``count`` - 1 into at most ``most`` runs, since neighbouring frames are dependent."""
    return [block for block in np.array_split(np.arange(count), min(most, count)) if len(block)]


def curves_of(inner: Array, n_vertices: int, most: int, seed: int = 0) -> Curves:
    """Compute the curves of examples from their inner products.

    Args:
        inner: Inner products of the examples' displacements from the neutral face, cm², in temporal order, (n, n).
        n_vertices: Number of vertices of the mesh.
        most: Largest number of components.
        seed: Random seed of the draws.
    """
    n = len(inner)
    most = max(1, min(most, n))
    total = float(np.trace(inner))
    energies, axes = _eigen(inner)
    compact = np.cumsum(energies[:most]) / max(total, _TINY)
    return Curves(
        tuple(range(1, most + 1)),
        tuple(np.minimum(compact, 1.0).tolist()),
        tuple(_generalization(inner, n_vertices, most)) if n >= 4 else (),
        tuple(_specificity(energies, axes, inner, n_vertices, most, seed)),
        float(np.sqrt(np.diag(inner).clip(0.0) / n_vertices).mean()),
    )


def _eigen(inner: Array) -> tuple[Array, Array]:
    values, axes = np.linalg.eigh(inner)
    return np.maximum(values[::-1], 0.0), axes[:, ::-1]


def _generalization(inner: Array, n_vertices: int, most: int) -> list[float]:
    n = len(inner)
    errors = np.zeros((n, most))
    for block in contiguous_blocks(n):
        kept = np.setdiff1d(np.arange(n), block)
        values, axes = _eigen(inner[np.ix_(kept, kept)])
        real = values > 1e-10 * max(values[0], _TINY)
        scores = inner[np.ix_(block, kept)] @ (axes[:, real] / np.sqrt(values[real]))
        explained = np.cumsum(scores**2, axis=1)[:, :most]
        if explained.shape[1] < most:
            last = explained[:, -1:] if explained.shape[1] else np.zeros((len(block), 1))
            explained = np.hstack([explained, np.repeat(last, most - explained.shape[1], axis=1)])
        errors[block] = np.sqrt((np.diag(inner)[block, None] - explained).clip(0.0) / n_vertices)
    return errors.mean(axis=0).tolist()


def _specificity(energies: Array, axes: Array, inner: Array, n_vertices: int, most: int, seed: int) -> list[float]:
    scores = (axes * np.sqrt(energies))[:, :most]
    if len(inner) < 2:
        return [0.0] * most
    rng = np.random.default_rng(seed)
    # Spread about the mean, since displacements are relative to the neutral face. With a triangular factor, draws over
    # m components are the first m numbers of draws over more, so that the curve is smooth.
    covariance = np.cov(scores.T, bias=True).reshape(most, most)
    factor = np.linalg.cholesky(covariance + 1e-9 * max(float(np.trace(covariance)), _TINY) * np.eye(most))
    draws = scores.mean(axis=0) + rng.standard_normal((_DRAWS, most)) @ factor.T
    results = []
    for m in range(1, most + 1):
        # A draw is zero along the other components; the example's share there adds to the distance.
        lengths = (scores[:, :m] ** 2).sum(axis=1)
        rest = (np.diag(inner) - lengths).clip(0.0)
        squared = ((draws[:, :m] ** 2).sum(axis=1)[:, None] - 2.0 * draws[:, :m] @ scores[:, :m].T) + lengths
        nearest = (squared + rest).min(axis=1).clip(0.0)
        results.append(float(np.sqrt(nearest / n_vertices).mean()))
    return results
