"""Recognition of the feature that a stroke depicts: its input and its result."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DrawnStroke:
    """A stroke in the image of a camera.

    Attributes:
        pixels: Its points in the order of drawing, shape (n, 2), n ≥ 2.
        camera: The camera under which it was drawn.
        feature: Name of the feature that it depicts, if known.
    """

    pixels: Array
    camera: Camera
    feature: str | None = None


@dataclass(frozen=True)
class MatchedPoint:
    """A feature point and its place on a stroke.

    Attributes:
        feature_point: MPEG-4's name, such as "8.4".
        pixel: The place on the stroke.
        probability: Probability of the match, from 0 to 1.
    """

    feature_point: str
    pixel: tuple[float, float]
    probability: float = 1.0


@dataclass(frozen=True)
class Candidate:
    """A feature that a stroke may depict.

    Attributes:
        feature: Its name, one of ``FEATURES``.
        probability: Posterior probability, among all features and strokes that depict none.
        points: Matched feature points, in the order of the feature's chain; points beyond the stroke's ends are absent.
    """

    feature: str
    probability: float
    points: tuple[MatchedPoint, ...]


@dataclass(frozen=True)
class Recognition:
    """The result for one stroke.

    Attributes:
        candidates: Candidates by decreasing probability.
        accepted: True if the best candidate is more probable than a stroke that depicts no feature.
        reason: Why the stroke cannot depict a feature at all, for a sentence; empty if that is not known.
    """

    candidates: tuple[Candidate, ...]
    accepted: bool
    reason: str = ""

    @property
    def best(self) -> Candidate | None:
        """The recognised feature, or None if the stroke depicts none."""
        return self.candidates[0] if self.accepted and self.candidates else None

    @property
    def runner_up(self) -> Candidate | None:
        """The second candidate of an accepted stroke, or the first of one that is not, or None."""
        index = 1 if self.accepted else 0
        return self.candidates[index] if len(self.candidates) > index else None


class Recogniser(Protocol):
    """A method of recognition for one character."""

    def recognise(
        self, stroke: DrawnStroke, pose: Array, others: Sequence[DrawnStroke] = (), feature: str | None = None
    ) -> Recognition:
        """Return the recognition of ``stroke``.

        Args:
            stroke: The stroke; its own ``feature`` is ignored.
            pose: Present pose of the face, shape (r,).
            others: Strokes that have been drawn before, with their features.
            feature: Name of a feature that the stroke is known to depict; only its points are matched then.
        """
        ...
