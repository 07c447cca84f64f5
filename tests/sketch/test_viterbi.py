"""Max-sum against the enumeration of all paths."""

from itertools import pairwise, product

import numpy as np
import pytest

from faceposer.sketch.viterbi import best_path


@pytest.mark.parametrize("seed", range(8))
def test_best_path_is_the_best_of_all(seed: int) -> None:
    rng = np.random.default_rng(seed)
    states, n = int(rng.integers(1, 5)), int(rng.integers(1, 6))
    start, transition, emission = (
        rng.normal(size=states),
        rng.normal(size=(states, states)),
        rng.normal(size=(n, states)),
    )

    def score(path: tuple[int, ...]) -> float:
        steps = sum(transition[a, b] for a, b in pairwise(path))
        return float(start[path[0]] + steps + sum(emission[i, z] for i, z in enumerate(path)))

    best = max(product(range(states), repeat=n), key=score)
    path, probability = best_path(start, transition, emission)
    assert tuple(path.tolist()) == best
    assert probability == pytest.approx(score(best))
