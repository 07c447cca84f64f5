"""The most probable path through a hidden Markov model, by max-sum."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ids = NDArray[np.intp]


def best_path(start: Array, transition: Array, emission: Array) -> tuple[Ids, float]:
    """Return the most probable path of states, shape (n,), and its log probability (Viterbi 1967).

    It maximises ln p(z_1) + sum ln p(z_n | z_n-1) + sum ln p(x_n | z_n) (Gunnarsson and Maddock 2010, equation (3)).

    Args:
        start: Log probabilities of the first state, shape (S,).
        transition: Log probabilities from state i to state j, shape (S, S).
        emission: Log probabilities of each of n observations in each state, shape (n, S).
    """
    n, count = emission.shape
    score = start + emission[0]
    before = np.zeros((n, count), dtype=np.intp)
    for i in range(1, n):
        steps = score[:, None] + transition
        before[i] = steps.argmax(axis=0)
        score = steps.max(axis=0) + emission[i]
    path = np.empty(n, dtype=np.intp)
    path[-1] = score.argmax()
    for i in range(n - 1, 0, -1):
        path[i - 1] = before[i, path[i]]
    return path, float(score.max())
