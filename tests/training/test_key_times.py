"""Times at which curves with keys of their own are sampled."""

import numpy as np

from faceposer.training.key_times import Sampling, sampling


def test_a_given_rate_is_stated_beside_the_distance_of_keys() -> None:
    keys = [np.array([0.0, 30.0, 60.0])]
    for rate in (None, 24.0):
        even = sampling(keys, 10_000, rate)
        assert isinstance(even, Sampling)
        assert even.rate == (rate or 30.0)
        assert even.note == f"Its keys are 30 s apart; they were interpolated at {even.rate:g} frames per second."
