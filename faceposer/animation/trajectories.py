"""Trajectories: positions of a few points of a face, frame by frame (Lau et al. 2009, section 7)."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoints
from faceposer.solve.constraints.fixed import PX_PER_CM

Array = NDArray[np.float64]

# A position is an outlier if its distance from the median of so many frames exceeds so many times the usual distance.
_AROUND, _JUMP = 7, 4.0
# Minimum distance of an outlier, in pixels.
_LEAST_JUMP_PX = 10.0


@dataclass(frozen=True, eq=False)
class Trajectories:
    """Trajectories of P points of a face over F frames, in an image or in space.

    Attributes:
        names: Names of the points, for messages and files.
        points: The points on the face.
        positions: Shape (F, P, 2) in pixels of ``camera``, or (F, P, 3) in the space and unit of the face, with a fixed
            head; NaN where a point was not seen.
        rate: Frames per second.
        camera: Camera of the image; None in space.
        weights: Factors on the energy of each point, at least 0, shape (P,) or (F, P); None for 1.
        notes: What was assumed or is missing in a file, one sentence each.

    Raises:
        ValueError: If the arrays do not fit together.
    """

    names: tuple[str, ...]
    points: SurfacePoints
    positions: Array
    rate: float
    camera: Camera | None = None
    weights: Array | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        positions = np.array(self.positions, dtype=np.float64)
        n_axes = 3 if self.camera is None else 2
        if positions.ndim != 3 or positions.shape[1:] != (len(self.points), n_axes) or not len(positions):
            raise ValueError(
                f"positions of {len(self.points)} points in {n_axes} axes cannot have shape {positions.shape}"
            )
        if len(self.names) != len(self.points):
            raise ValueError(f"{len(self.names)} names do not match {len(self.points)} points")
        if not (np.isfinite(self.rate) and self.rate > 0):
            raise ValueError(f"a rate of {self.rate} frames per second is not positive")
        # A point without one of its coordinates counts as not seen.
        positions[~np.isfinite(positions).all(axis=2)] = np.nan
        positions.setflags(write=False)
        object.__setattr__(self, "positions", positions)
        if self.weights is not None:
            weights = np.array(self.weights, dtype=np.float64)
            if weights.shape not in {positions.shape[1:2], positions.shape[:2]}:
                raise ValueError(f"weights of shape {weights.shape} for positions of shape {positions.shape}")
            if not (np.isfinite(weights).all() and (weights >= 0).all()):
                raise ValueError("weights must be finite and at least 0")
            weights.setflags(write=False)
            object.__setattr__(self, "weights", weights)

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Mask of the frames in which each point was seen, shape (F, P)."""
        return np.asarray(np.isfinite(self.positions).all(axis=2))

    def weights_at(self, frame: int) -> Array:
        """Return the factor on the energy of each point in ``frame``, shape (P,)."""
        if self.weights is None:
            return np.ones(len(self.points))
        return self.weights if self.weights.ndim == 1 else self.weights[frame]

    def without_jumps(self) -> tuple["Trajectories", int]:
        """Return the trajectories without outliers of a frame or two, and their number.

        An outlier is farther from the median of its point over the surrounding frames than usual (Hampel 1974), and
        farther than noise and fast movements of a face.
        """
        half = _AROUND // 2
        padded = np.pad(self.positions, ((half, half), (0, 0), (0, 0)), constant_values=np.nan)
        around = np.lib.stride_tricks.sliding_window_view(padded, _AROUND, axis=0)
        with warnings.catch_warnings():
            # A point that is not seen in any of these frames has no median, and no position to remove.
            warnings.simplefilter("ignore", RuntimeWarning)
            medians = np.nanmedian(around, axis=3)
            spread = np.nanmedian(np.linalg.norm(around - medians[..., None], axis=2), axis=2)
        distances = np.linalg.norm(self.positions - medians, axis=2)
        least = _LEAST_JUMP_PX / (PX_PER_CM if self.camera is None else 1.0)
        jumps = distances > np.maximum(_JUMP * spread, least)
        positions = np.where(jumps[:, :, None], np.nan, self.positions)
        return replace(self, positions=positions), int(jumps.sum())

    def subset(self, names: Sequence[str]) -> "Trajectories":
        """Return the trajectories of the points ``names``, in this order.

        Raises:
            ValueError: If there is no such point.
        """
        columns = np.array([self.names.index(name) for name in names], dtype=np.intp)
        weights = self.weights
        return replace(
            self,
            names=tuple(names),
            points=self.points.subset(columns),
            positions=self.positions[:, columns],
            weights=None if weights is None else weights[..., columns],
        )
