"""Prior probabilities of features by what has been drawn: people draw from above to below, and seldom twice.

The constants are close to those of the highest likelihood on two folds of a performance, half of the trials with
strokes in random order, and on strokes drawn by hand (docs/sketching.md).
"""

from collections.abc import Collection

from faceposer.model.feature_curves import FEATURES

# Log priors of the line of a closed mouth; of a lower lid before the upper one, and if a brow has been drawn, so that
# the eye is drawn from above; of an inner lower lip before the upper one; of a feature that has been drawn before.
_MOUTH_LINE, _LOWER_LID, _BELOW_BROW, _INNER_LOWER, _AGAIN = -1.15, -1.4, -2.1, -1.6, -1.6


def is_redrawn(feature: str, drawn: Collection[str]) -> bool:
    """Return True if ``feature`` or a component of it is among the ``drawn`` ones."""
    return feature in drawn or not set(FEATURES[feature].components).isdisjoint(drawn)


def log_prior(feature: str, drawn: Collection[str]) -> float:
    """Return the log prior of ``feature`` after others have been ``drawn``, relative to a feature like any other."""
    log = _AGAIN if is_redrawn(feature, drawn) else 0.0
    side, _, part = feature.partition(" ")
    if part == "lower lid" and f"{side} upper lid" not in drawn:
        log += _LOWER_LID + (_BELOW_BROW if any(name.endswith("brow") for name in drawn) else 0.0)
    elif feature == "inner lower lip" and "inner upper lip" not in drawn:
        log += _INNER_LOWER
    elif feature == "mouth line":
        log += _MOUTH_LINE
    return log
