"""People draw from above to below, seldom twice, and the line of a mouth by where its middle is."""

import numpy as np
import pytest

from faceposer.model.feature_curves import FEATURES
from faceposer.sketch.drawing_order import is_redrawn, log_prior
from faceposer.sketch.habits import Habits, as_drawn


def test_lower_lines_follow_upper_ones() -> None:
    for lower, upper in (("left lower lid", "left upper lid"), ("inner lower lip", "inner upper lip")):
        assert log_prior(lower, {upper}) == 0.0
        assert log_prior(lower, ()) < 0.0
    # An eye that is drawn from its brow on is drawn from above; the other eye tells nothing.
    assert log_prior("left lower lid", {"right brow"}) < log_prior("left lower lid", {"right lower lid"})
    assert log_prior("left lower lid", {"right upper lid"}) == log_prior("left lower lid", ())
    assert log_prior("left lower lid", {"left brow", "left upper lid"}) == 0.0


def test_both_sides_have_the_same_priors() -> None:
    drawn = {"left brow", "right lower lid", "outer upper lip", "left eye outline"}
    mirrored = {FEATURES[name].mirror for name in drawn}
    for name, feature in FEATURES.items():
        assert log_prior(name, drawn) == log_prior(feature.mirror, mirrored)


def test_features_and_their_outlines_are_seldom_drawn_twice() -> None:
    assert is_redrawn("left eye outline", {"left lower lid"})
    assert not is_redrawn("left lower lid", {"left eye outline"})
    assert log_prior("left brow", {"left brow"}) < log_prior("left brow", ()) == 0.0


@pytest.mark.parametrize("on_line", [0.0, 0.5, 1.0])
def test_a_line_of_the_mouth_may_turn_as_far_as_a_lip(on_line: float) -> None:
    names = ["outer lower lip", "mouth line", "outer upper lip"]
    logs = np.array([-70.0, -80.0, -60.0])
    raised = as_drawn(names, logs, Habits({}, on_line))
    assert raised == pytest.approx([-70.0, -80.0 + 10.0 * on_line, -60.0])
    assert logs[1] == -80.0
    # A line that is likelier already gains nothing.
    assert as_drawn(names, np.array([-80.0, -70.0, -60.0]), Habits({}, on_line))[1] == -70.0
    assert as_drawn(names[:1], logs[:1], Habits({}, on_line)) == pytest.approx(logs[:1])
