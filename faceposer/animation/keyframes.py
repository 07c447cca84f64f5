"""Keyframe animation: poses at some frames, and the smooth motion between them."""

import itertools
from bisect import bisect_left, bisect_right
from collections.abc import Collection, Iterable
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Annotated, Any, get_args

import numpy as np
from msgspec import UNSET, Meta, UnsetType
from numpy.typing import ArrayLike, NDArray

from faceposer.errors import FacePoserError
from faceposer.files.json_documents import JsonError, JsonObject
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.progress import Progress
from faceposer.sketch.inbetweens import Inbetweens, PointSpline, point_faces
from faceposer.solve.constraints.codec import Coordinate, ShapeWeights, weights_to_json

Array = NDArray[np.float64]

LONGEST = 100_000
#: Default tolerance of a rig weight when keys are reduced.
TOLERANCE = 0.02
FASTEST = 1000.0
_MOST_COEFFICIENTS = 4096
#: Ways to the poses between keys, the default first.
INBETWEENS: tuple[Inbetweens, ...] = get_args(Inbetweens)

Frame = Annotated[int, Meta(ge=0, lt=LONGEST)]


class _KeyJson(JsonObject):
    frame: Frame
    coefficients: Annotated[list[Coordinate], Meta(max_length=_MOST_COEFFICIENTS)]
    weights: ShapeWeights | UnsetType = UNSET

    def key(self) -> "Key":
        weights = None if self.weights is UNSET else np.array(self.weights)
        return replace(Key.of(self.frame, self.coefficients), weights=weights)


class _FilmJson(JsonObject):
    path: Annotated[str, Meta(min_length=1, max_length=4096)]
    first: Annotated[int, Meta(ge=0, le=10**9)]
    rate: Annotated[float, Meta(ge=1e-3, le=FASTEST)]


class KeyframesJson(JsonObject, kw_only=True):
    """The keys in a session file."""

    rate: Annotated[float, Meta(ge=1e-3, le=FASTEST)]
    length: Annotated[int, Meta(ge=1, le=LONGEST)]
    keys: Annotated[list[_KeyJson], Meta(max_length=LONGEST)]
    loop: bool = False
    inbetweens: Inbetweens = "poses"
    film: _FilmJson | UnsetType = UNSET

    def __post_init__(self) -> None:
        """Check that the frames increase."""
        for i, (earlier, later) in enumerate(itertools.pairwise(self.keys), start=1):
            if later.frame <= earlier.frame:
                raise JsonError(
                    f"must be greater than {earlier.frame}, the frame of the previous key", f"keys[{i}].frame"
                )

    def keyframes(self) -> "Keyframes":
        """Return the animation."""
        keys = tuple(key.key() for key in self.keys)
        film = None if self.film is UNSET else FilmSource(self.film.path, self.film.first, self.film.rate)
        return Keyframes(keys, self.rate, self.length, self.loop, self.inbetweens, film)


@dataclass(frozen=True)
class FilmSource:
    """The film that an animation follows.

    Attributes:
        path: Its file or folder.
        first: Frame of the film at which the animation begins.
        rate: Frames of the film per second.
    """

    path: str
    first: int
    rate: float

    def number(self, frame: int, rate: float) -> int:
        """Return the frame of the film that belongs to a ``frame`` of the animation at ``rate``."""
        return self.first + round(frame * self.rate / rate)


@dataclass(frozen=True, eq=False)
class Key:
    """A pose of the animation at one frame.

    Attributes:
        frame: Frame, counted from 0.
        pose: Coefficients, shape (r,), read-only.
        weights: Shape weights of the pose, shape (S,), in a file; None in memory.
    """

    frame: int
    pose: Array
    weights: Array | None = None

    @classmethod
    def of(cls, frame: int, pose: ArrayLike) -> "Key":
        """Return a key with a copy of ``pose``, shape (r,)."""
        coefficients = np.array(pose, dtype=np.float64)
        coefficients.setflags(write=False)
        return cls(frame, coefficients)


@dataclass(frozen=True, eq=False)
class Keyframes:
    """An immutable keyframe animation; every edit returns a new one.

    Between two keys, each rig weight follows a cubic that stays in the range of its two key values (F. N. Fritsch and
    J. Butland, "A method for constructing local monotone piecewise cubic interpolants", 1984), so that an eye that
    closes and opens again does not overshoot. Alternatively, a spline through the feature points of the keys gives the
    poses (``sketch.inbetweens``), which may overshoot; what the feature points do not tell of the keys follows the
    cubics, so that keys are exact either way. The motion has zero velocity at the first and last key and is constant
    outside of them; a looping animation is periodic.

    Attributes:
        keys: Keys at increasing frames. Those at or after ``length`` are kept, but not played.
        rate: Frames per second.
        length: Number of played frames, from 1 to ``LONGEST``.
        loop: True if frame ``length`` is frame 0 again.
        inbetweens: "poses" for curves of rig weights, "feature points" for splines of feature points.
        film: The film that it follows, which is shown beside the face, or None.
    """

    keys: tuple[Key, ...] = ()
    rate: float = 30.0
    length: int = 60
    loop: bool = False
    inbetweens: Inbetweens = "poses"
    film: FilmSource | None = None

    def __post_init__(self) -> None:
        frames = [key.frame for key in self.keys]
        if any(later <= earlier for earlier, later in itertools.pairwise(frames)):
            raise ValueError("the frames of keys must increase")
        if frames and not (frames[0] >= 0 and frames[-1] < LONGEST):
            raise ValueError(f"the frames of keys must be from 0 to {LONGEST - 1}")
        if not (1 <= self.length <= LONGEST and 0.0 < self.rate <= FASTEST):
            raise ValueError(f"{self.length} frames at {self.rate} per second are out of range")
        if self.inbetweens not in INBETWEENS:
            raise ValueError(f"in-betweens are {' or '.join(INBETWEENS)}, not {self.inbetweens!r}")

    # Queries

    @cached_property
    def frames(self) -> tuple[int, ...]:
        """The frames of all keys, increasing."""
        return tuple(key.frame for key in self.keys)

    def at(self, frame: int) -> Key | None:
        """Return the key at ``frame``, or None."""
        i = bisect_left(self.frames, frame)
        return self.keys[i] if i < len(self.keys) and self.keys[i].frame == frame else None

    def next_frame(self, frame: int) -> int | None:
        """Return the frame of the first key after ``frame``, or None."""
        i = bisect_right(self.frames, frame)
        return self.frames[i] if i < len(self.frames) else None

    def previous_frame(self, frame: int) -> int | None:
        """Return the frame of the last key before ``frame``, or None."""
        i = bisect_left(self.frames, frame)
        return self.frames[i - 1] if i > 0 else None

    def same(self, other: "Keyframes | None") -> bool:
        """Return True if ``other`` is the same animation."""
        if other is None or other is self:
            return other is self
        return (
            self.frames == other.frames
            and (self.rate, self.length, self.loop) == (other.rate, other.length, other.loop)
            and (self.inbetweens, self.film) == (other.inbetweens, other.film)
            # An edit keeps the keys that it does not change.
            and all(
                key is other_key or np.array_equal(key.pose, other_key.pose)
                for key, other_key in zip(self.keys, other.keys, strict=True)
            )
        )

    # Edits

    def with_keys(self, keys: Iterable[Key]) -> "Keyframes":
        """Return the animation with ``keys`` added, replacing those at the same frames."""
        merged = {key.frame: key for key in (*self.keys, *keys)}
        return replace(self, keys=tuple(merged[frame] for frame in sorted(merged)))

    def with_key(self, frame: int, pose: ArrayLike) -> "Keyframes":
        """Return the animation with a key for ``pose``, shape (r,), at ``frame``."""
        return self.with_keys([Key.of(frame, pose)])

    def without(self, frames: Collection[int]) -> "Keyframes":
        """Return the animation without the keys at ``frames``."""
        return replace(self, keys=tuple(key for key in self.keys if key.frame not in frames))

    def moved(self, frames: Collection[int], by: int) -> "Keyframes":
        """Return the animation with the keys at ``frames`` moved ``by`` frames, replacing those at their new frames."""
        chosen = [key for key in self.keys if key.frame in frames]
        return self.without(frames).with_keys(_shifted(chosen, by))

    def copied(self, frames: Collection[int], by: int) -> "Keyframes":
        """Return the animation with copies of the keys at ``frames``, ``by`` frames later."""
        return self.with_keys(_shifted([key for key in self.keys if key.frame in frames], by))

    # Motion

    def sampled(self, model: FaceModel, frames: ArrayLike) -> Array:
        """Return the poses of ``model`` at ``frames``, which need not be whole; shapes (n,) to (n, r).

        The cubics interpolate rig weights and not coefficients, because monotone coefficients need not give monotone
        weights. The result is the closest pose of the subspace, which can exceed the range only by its truncation
        error. Splines of feature points are not limited to the range.
        """
        queries = np.asarray(frames, dtype=np.float64).reshape(-1)
        keys = [key for key in self.keys if not self.loop or key.frame < self.length]
        if not keys:
            return np.zeros((len(queries), model.n_coefficients))
        if len(keys) == 1:
            return np.repeat(keys[0].pose[None], len(queries), axis=0)
        places = np.array([key.frame for key in keys], dtype=np.float64)
        poses = np.stack([key.pose for key in keys])
        if self.loop:
            queries = np.mod(queries, self.length)
            knots = np.concatenate([places[-2:] - self.length, places, places[:2] + self.length])
            values = np.concatenate([poses[-2:], poses, poses[:2]])
        else:
            queries = np.clip(queries, places[0], places[-1])
            knots, values = places, poses
        if self.inbetweens == "poses":
            sampled = _monotone(model, knots, values, self.loop, queries)
        else:
            spline = PointSpline(point_faces(model), knots, values)
            sampled = spline.poses_at(queries) + _monotone(model, knots, spline.residuals, self.loop, queries)
        # The conversion to weights and back is inexact in the last digits: keys are returned exactly.
        nearest = np.minimum(np.searchsorted(places, queries), len(places) - 1)
        at_key = places[nearest] == queries
        sampled[at_key] = poses[nearest[at_key]]
        return sampled

    def performance(self, model: FaceModel) -> Performance:
        """Return the motion of ``model`` frame by frame."""
        return Performance(self.sampled(model, np.arange(self.length)), self.rate)

    @classmethod
    def of_performance(cls, performance: Performance, loop: bool = False) -> "Keyframes":
        """Return an animation with a key at every frame of ``performance``.

        Raises:
            FacePoserError: If the performance is longer than the maximum of an animation.
        """
        if len(performance) > LONGEST:
            raise FacePoserError(
                f"This animation has {len(performance)} frames, more than the maximum of {LONGEST}; use a part of it."
            )
        keys = tuple(Key.of(frame, pose) for frame, pose in enumerate(performance.coefficients))
        return cls(keys, min(performance.rate, FASTEST), len(performance), loop)

    def reduced(self, model: FaceModel, tolerance: float | Array, progress: Progress | None = None) -> "Keyframes":
        """Return the animation with only the keys needed to approximate all rig weights within ``tolerance``.

        Greedy: between the kept keys, the one with the largest error is added until no error exceeds the tolerance (as
        in D. H. Douglas and T. K. Peucker, 1973, for polygons).

        Args:
            model: Model of the face.
            tolerance: Largest error of a rig weight, or that of each, shape (S,).
            progress: Checked for cancellation.

        Raises:
            CancelledError: If the progress was cancelled.
        """
        progress = progress or Progress()
        if len(self.keys) < 3:
            return self
        poses = np.stack([key.pose for key in self.keys])
        frames = np.array(self.frames)
        kept = np.zeros(len(frames), dtype=bool)
        kept[[0, -1]] = True
        while True:
            fewer = replace(self, keys=tuple(key for key, keep in zip(self.keys, kept, strict=True) if keep))
            progress.check()
            off = np.abs((fewer.sampled(model, frames) - poses) @ model.subspace.directions.T)
            # Relative to what is tolerated.
            errors = (off / tolerance).max(axis=1)
            errors[kept] = 0.0
            ends = np.flatnonzero(kept)
            worst = [a + int(np.argmax(errors[a:b])) for a, b in itertools.pairwise(ends)]
            added = [i for i in worst if errors[i] > 1.0]
            if not added:
                return fewer
            kept[added] = True

    # File

    def to_json(self) -> dict[str, Any]:
        """Return the animation as written in a session file."""
        return {
            "rate": self.rate,
            "length": self.length,
            "loop": self.loop,
            "keys": [_key_to_json(key) for key in self.keys],
        } | self._set_json()

    def _set_json(self) -> dict[str, Any]:
        """Return what is only written if it is not the default."""
        ways = {} if self.inbetweens == "poses" else {"inbetweens": self.inbetweens}
        return ways if self.film is None else ways | {"film": asdict(self.film)}


def _monotone(model: FaceModel, knots: Array, poses: Array, periodic: bool, queries: Array) -> Array:
    """Return the poses at ``queries``, shape (m, r), by monotone cubics through the rig weights of ``poses``, (n, r).

    Unless they are ``periodic``, the cubics rest at the first and the last knot.
    """
    # Imported late: it takes a good part of a second to load.
    from scipy.interpolate import PchipInterpolator

    weights = poses @ model.subspace.directions.T
    if not periodic:
        knots = np.concatenate([[knots[0] - 1.0], knots, [knots[-1] + 1.0]])
        weights = np.concatenate([weights[:1], weights, weights[-1:]])
    sampled: Array = PchipInterpolator(knots, weights, axis=0)(queries) @ model.subspace.projection.T
    return sampled


def _key_to_json(key: Key) -> dict[str, Any]:
    data: dict[str, Any] = {"frame": key.frame, "coefficients": key.pose.tolist()}
    return data if key.weights is None else data | {"weights": weights_to_json(key.weights)}


def _shifted(keys: list[Key], by: int) -> list[Key]:
    """Return ``keys`` moved ``by`` frames, limited so that all remain in the valid range."""
    if not keys:
        return keys
    by = min(max(by, -keys[0].frame), LONGEST - 1 - keys[-1].frame)
    return [Key(key.frame + by, key.pose) for key in keys]
