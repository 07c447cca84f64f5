"""The recognition of Gunnarsson and Maddock (2010, section 4.3): a hidden Markov model over feature points.

Each point of a stroke has a responsibility for every drawable feature point (4), which is its emission. Transitions (5)
depend on the path length between feature points, 1 between neighbours of a feature and large between features. The
first point decides the start: if it maps to a boundary point of a feature, such as a corner of the mouth, the path
starts there. Viterbi gives the path (3), and each feature point takes the stroke point of highest emission.

The paper names feature points only. Here a path is sought in each feature on its own; since transitions between
features are all but impossible, the best of these paths is the paper's, and the others are the runners-up.

As printed, staying at a feature point (path length 0) costs as much as skipping one (2), exp(-5.6) with sigma_s = 0.3,
although strokes have more points than features: paths alternate between neighbours.

Responsibilities saturate: of many stroke points that belong to a feature point almost certainly, the one of highest
emission is that farthest from all others, not that nearest to its mean. It is about as good for the pose.

The paper accepts every stroke. Here a stroke must be more probable than one whose points lie anywhere on the face.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.model.face_model import FaceModel
from faceposer.model.feature_curves import FEATURES
from faceposer.sketch.plausibility import objection
from faceposer.sketch.point_mixture import DEPTH_ERROR, PointMixture, Rays
from faceposer.sketch.polyline import evenly
from faceposer.sketch.recognition import Candidate, DrawnStroke, MatchedPoint, Recognition
from faceposer.sketch.training_poses import TrainingPoses
from faceposer.sketch.visible_surface import VisibleSurface
from faceposer.sketch.viterbi import best_path

Array = NDArray[np.float64]
Ids = NDArray[np.intp]

#: sigma_s of (5), and the path length between feature points of different features.
SIGMA_S, FAR = 0.3, 10.0
# Number of points of a stroke by arc length, and of independent ones among them: neighbours err together.
_SAMPLES, _INDEPENDENT = 32, 6.0
# Log probability of a start that the boundary rule rules out.
_RULED_OUT = -30.0
# Standard deviation of a stroke's points, as a share of the head's height: less than HAND_ERROR, because all points of
# a stroke have a part of it in common.
_POINT_ERROR = 0.0075
# Area, as a share of the head's height squared, over which the points of other strokes are spread. Scribbles lie about
# the features, too.
_FACE_AREA = 0.08
# Standard deviation of a stroke from the straight line between two matched points, as a share of their distance.
_BEND = 0.08


@dataclass(frozen=True, eq=False)
class _Chain:
    """The states of one feature: indices of feature points, two for each state of a mouth line."""

    feature: str
    names: tuple[tuple[str, ...], ...]
    states: NDArray[np.intp]
    ends: tuple[int, ...]
    parts: tuple[frozenset[str], ...]


class PaperRecogniser:
    """Recognition by a hidden Markov model over the feature points of one character."""

    def __init__(self, model: FaceModel, training: TrainingPoses) -> None:
        """Fit the mixture over feature points.

        Args:
            model: The character's model, whose surface gives the first estimate of depth.
            training: Training poses.
        """
        height = model.character.height
        names = training.drawable
        points = training.points[:, [training.index[name] for name in names]]
        self.mixture = PointMixture.fit(points, names, _POINT_ERROR * height)
        self._surface = VisibleSurface(model, training)
        self._character = model.character
        self._depth_error = DEPTH_ERROR * height
        self._log_background = -float(np.log(_FACE_AREA * height**2))
        self._chains = tuple(_chain(feature, names) for feature in training.features)
        self._transitions = _log_transitions(names)

    def recognise(
        self, stroke: DrawnStroke, pose: Array, others: Sequence[DrawnStroke] = (), feature: str | None = None
    ) -> Recognition:
        """Return the recognition of ``stroke``; see ``Recogniser.recognise``.

        The paper looks at one stroke at a time; of ``others`` nothing is used.
        """
        reason = objection(stroke, self._character, feature is not None)
        if not self._chains or reason:
            return Recognition((), False, reason)
        pixels = evenly(stroke.pixels, _SAMPLES)
        rays = Rays.through(stroke.camera, pixels)
        surface = self._surface.under(stroke.camera, pixels, pose)
        across, along = self.mixture.log_parts(rays, surface, self._depth_error)
        joint = np.log(self.mixture.weights) + across + along
        emission = joint - np.logaddexp.reduce(joint, axis=1)[:, None]
        start = self._start(emission[0])
        paths = []
        for chain in self._chains:
            if feature is None or chain.feature == feature:
                path, score = self._path(chain, start, emission)
                if feature is not None or _is_whole(chain, path):
                    paths.append((chain, path, score))
        if not paths:
            return Recognition((), False)
        scores = np.array([score for _, _, score in paths])
        shares = np.exp((scores - scores.max()) * (_INDEPENDENT / _SAMPLES))
        shares /= shares.sum()
        best = int(scores.argmax())
        ratio = self._ratio(*paths[best][:2], stroke, pixels, rays, emission, across)
        chance = (
            1.0 if feature is not None else float(1.0 / (1.0 + np.exp(-np.clip(_INDEPENDENT * ratio, -50.0, 50.0))))
        )
        candidates = [
            Candidate(chain.feature, float(share * chance), self._matches(chain, path, pixels, emission))
            for (chain, path, _), share in zip(paths, shares, strict=True)
        ]
        candidates.sort(key=lambda candidate: -candidate.probability)
        return Recognition(tuple(candidates), feature is not None or chance > 0.5)

    def _start(self, emission: Array) -> Array:
        """Return ln pi, shape (F,): the responsibilities of the first point, or 1 for the boundary point it maps to."""
        first = int(emission.argmax())
        if all(first not in chain.ends for chain in self._chains):
            return emission
        start = np.full(len(emission), _RULED_OUT)
        start[first] = 0.0
        return start

    def _path(self, chain: _Chain, start: Array, emission: Array) -> tuple[Ids, float]:
        """Return the best path among the states of ``chain``, shape (n,), and its log probability."""
        of_states = _on_all(emission, chain.states)
        first, second = chain.states[:, :1], chain.states[:, -1:]
        both = self._transitions[first, first.T], self._transitions[second, second.T]
        return best_path(start[chain.states].max(axis=1), np.maximum(*both), of_states)

    def _matches(self, chain: _Chain, path: Ids, pixels: Array, emission: Array) -> tuple[MatchedPoint, ...]:
        """Return the stroke point of highest emission of each feature point on ``path``, in the chain's order."""
        of_states = _on_all(emission, chain.states)
        matches = []
        for state, names in enumerate(chain.names):
            places = np.flatnonzero(path == state)
            if len(places):
                best = int(places[of_states[places, state].argmax()])
                u, v = pixels[best].tolist()
                chance = float(np.exp(min(of_states[best, state], 0.0)))
                matches += [MatchedPoint(name, (u, v), chance) for name in names]
        return tuple(matches)

    def _ratio(
        self, chain: _Chain, path: Ids, stroke: DrawnStroke, pixels: Array, rays: Rays, emission: Array, across: Array
    ) -> float:
        """Return the mean log ratio of the stroke's likelihood as this feature to that of one anywhere on the face.

        The feature explains its matched points by their Gaussians, and the points between by straight lines.
        """
        of_states = _on_all(emission, chain.states)
        visited = [s for s in range(len(chain.names)) if (path == s).any()]
        at = np.array([np.flatnonzero(path == s)[of_states[path == s, s].argmax()] for s in visited])
        # The most likely point of each, whichever the responsibilities choose.
        matched = np.array([across[path == s, chain.states[s, 0]].max() for s in visited])
        places = self.mixture.placed(rays, chain.states[path, 0])
        scale = stroke.camera.focal / float(stroke.camera.to_camera(places)[:, 2].mean())
        order = np.argsort(at)
        between = _log_between(pixels / scale, at[order], self.mixture.hand_error)
        missing = len(chain.names) - len(visited)
        points = (float(matched.sum()) + missing * self._log_background) / len(chain.names)
        return 0.5 * (points + between) - self._log_background


def _chain(feature: str, names: tuple[str, ...]) -> _Chain:
    """Return the states of ``feature`` among the drawable points ``names``."""
    index = {name: i for i, name in enumerate(names)}
    described = FEATURES[feature]
    states = tuple(tuple(dict.fromkeys(column)) for column in zip(*described.chains, strict=True))
    ids = np.array([[index[state[0]], index[state[-1]]] for state in states], dtype=np.intp)
    ends = () if described.closed else (int(ids[0, 0]), int(ids[-1, 0]))
    parts = tuple(frozenset(FEATURES[part].points) for part in described.components)
    return _Chain(feature, states, ids, ends, parts)


def path_lengths(names: tuple[str, ...]) -> Array:
    """Return gamma, the path length between feature points within a feature, ``FAR`` between features, shape (F, F)."""
    lengths = np.full((len(names), len(names)), FAR)
    np.fill_diagonal(lengths, 0.0)
    index = {name: i for i, name in enumerate(names)}
    for feature in FEATURES.values():
        for chain in feature.chains:
            if all(name in index for name in chain):
                ids = [index[name] for name in chain]
                steps = np.abs(np.subtract.outer(np.arange(len(ids)), np.arange(len(ids)))).astype(np.float64)
                if feature.closed:
                    steps = np.minimum(steps, len(ids) - steps)
                block = np.ix_(ids, ids)
                lengths[block] = np.minimum(lengths[block], steps)
    return lengths


def _log_transitions(names: tuple[str, ...]) -> Array:
    """Return ln p(z_j | z_i) of equation (5), normalised over j, shape (F, F)."""
    energies = -0.5 * ((path_lengths(names) - 1.0) / SIGMA_S) ** 2
    return np.asarray(energies - np.logaddexp.reduce(energies, axis=1)[:, None])


def _on_all(emission: Array, states: Ids) -> Array:
    """Return the log emission of states of one or two feature points, shape (n, S).

    A place on both lips of a closed mouth has half a responsibility for each: twice their geometric mean is 1 then, and
    small where the lips are apart.
    """
    a, b = emission[:, states[:, 0]], emission[:, states[:, 1]]
    return np.where(states[:, 0] == states[:, 1], a, 0.5 * (a + b) + np.log(2.0))


def _is_whole(chain: _Chain, path: Ids) -> bool:
    """Return True unless ``path`` visits one component of a feature alone, or does not return to where it began."""
    if chain.ends or not chain.parts:
        return True
    apart = abs(int(path[0]) - int(path[-1]))
    visited = {name for state in set(path.tolist()) for name in chain.names[state]}
    return min(apart, len(chain.names) - apart) <= 1 and not any(visited <= part for part in chain.parts)


def _log_between(places: Array, at: Ids, error: float) -> float:
    """Return the mean log likelihood of a stroke's ``places``, (n, 2), about straight lines through those ``at``.

    Args:
        places: In the character's unit.
        at: Indices of the matched points among them, in the order of the stroke.
        error: Standard deviation of a hand's error.
    """
    if len(at) < 2:
        return float(-0.5 * ((places - places[at[0]]) ** 2).sum(axis=1).mean() / error**2)
    knots = places[at]
    segment = np.clip(np.searchsorted(at, np.arange(len(places)), side="right") - 1, 0, len(at) - 2)
    a, b = knots[segment], knots[segment + 1]
    chord = b - a
    squared = np.maximum((chord**2).sum(axis=1), 1e-12)
    share = np.clip(((places - a) * chord).sum(axis=1) / squared, -0.5, 1.5)
    off = ((places - a - share[:, None] * chord) ** 2).sum(axis=1)
    variance = error**2 + _BEND**2 * squared
    return float(np.mean(-0.5 * off / variance - np.log(2.0 * np.pi * variance)))
