"""Errors of cloned animations."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CloneErrors:
    """Errors of cloned frames against the true ones.

    Attributes:
        paper: Error of Pyun et al. 2003, equation (12), in percent: distances relative to the norms of the vertices,
            mean over the frames. It depends on the origin.
        paper_axes: The same for the x, y and z coordinates, as in the paper's tables 2 and 3.
        displacement: Sum of all distances relative to that of the displacements from the neutral face; 1 is no better
            than the neutral face.
    """

    paper: float
    paper_axes: tuple[float, float, float]
    displacement: float


def clone_errors(clones: Array, truths: Array, neutral: Array) -> CloneErrors:
    """Return the errors of ``clones``, (F, N, 3), against ``truths``, (F, N, 3), of a face with the given neutral."""
    gaps = np.linalg.norm(clones - truths, axis=2)
    paper = 100.0 * gaps.sum(axis=1) / np.linalg.norm(truths, axis=2).sum(axis=1)
    x, y, z = (100.0 * np.abs(clones - truths).sum(axis=1) / np.abs(truths).sum(axis=1)).mean(axis=0).tolist()
    moved = np.linalg.norm(truths - neutral, axis=2).sum()
    return CloneErrors(float(paper.mean()), (x, y, z), float(gaps.sum() / max(moved, 1e-12)))
