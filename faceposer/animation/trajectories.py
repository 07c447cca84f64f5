"""Where a few points of a face were, frame by frame: what a face is to follow (Lau et al. 2009, section 7)."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoints
from faceposer.solve.constraints.fixed import PX_PER_CM

Array = NDArray[np.float64]

# A position is held against those of so many frames, and jumps if it is that many times as far off as they usually are.
_AROUND, _JUMP = 7, 4.0
# No less than this is a jump, in pixels.
_LEAST_JUMP_PX = 10.0


@dataclass(frozen=True, eq=False)
class Trajectories:
    """Trajectories of P points of a face over F frames, in a picture or in space.

    Attributes:
        names: What the points are called, for messages and files.
        points: Where they are on the face.
        positions: Shape (F, P, 2) in the pixels of ``camera``, or (F, P, 3) in the space and unit of the face, whose
            head does not move; NaN where a point was not seen.
        rate: Frames per second.
        camera: The camera of the picture; None in space.
        weights: Factors on each point's energy, at least 0, shape (P,) or (F, P); 1 if None.

    Raises:
        ValueError: If the arrays do not fit together.
    """

    names: tuple[str, ...]
    points: SurfacePoints
    positions: Array
    rate: float
    camera: Camera | None = None
    weights: Array | None = None

    def __post_init__(self) -> None:
        positions = np.array(self.positions, dtype=np.float64)
        n_axes = 3 if self.camera is None else 2
        if positions.ndim != 3 or positions.shape[1:] != (len(self.points), n_axes) or not len(positions):
            raise ValueError(f"positions of {len(self.points)} points by {n_axes} axes cannot be {positions.shape}")
        if len(self.names) != len(self.points):
            raise ValueError(f"{len(self.names)} names do not go with {len(self.points)} points")
        if not (np.isfinite(self.rate) and self.rate > 0):
            raise ValueError(f"{self.rate} frames per second")
        # A point of which one coordinate lacks was not seen.
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
        """Whether each point was seen in each frame, shape (F, P)."""
        return np.asarray(np.isfinite(self.positions).all(axis=2))

    def weights_at(self, frame: int) -> Array:
        """Return the factor on each point's energy in ``frame``, shape (P,)."""
        if self.weights is None:
            return np.ones(len(self.points))
        return self.weights if self.weights.ndim == 1 else self.weights[frame]

    def without_jumps(self) -> tuple["Trajectories", int]:
        """Return the trajectories without positions that jump away for a frame or two, and how many were left out.

        A position goes where it is farther from the median of its point over the frames around it than these usually
        are (Hampel 1974), and farther than noise and fast movements of a face take it.
        """
        half = _AROUND // 2
        padded = np.pad(self.positions, ((half, half), (0, 0), (0, 0)), constant_values=np.nan)
        around = np.lib.stride_tricks.sliding_window_view(padded, _AROUND, axis=0)
        with warnings.catch_warnings():
            # A point that is not seen for so long has no median, and no position to leave out.
            warnings.simplefilter("ignore", RuntimeWarning)
            medians = np.nanmedian(around, axis=3)
            spread = np.nanmedian(np.linalg.norm(around - medians[..., None], axis=2), axis=2)
        off = np.linalg.norm(self.positions - medians, axis=2)
        least = _LEAST_JUMP_PX / (PX_PER_CM if self.camera is None else 1.0)
        jumps = off > np.maximum(_JUMP * spread, least)
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
