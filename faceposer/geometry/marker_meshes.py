"""From the motion of markers to a mesh for each frame (section 3.1 of the paper)."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.alignment import determines_rotation, rigid_alignment
from faceposer.geometry.deform import MarkerDeformer
from faceposer.geometry.marker_io import MarkerMotion, fill_gaps
from faceposer.geometry.marker_map import MarkerMap
from faceposer.geometry.mesh import Floats, Ints

Array = NDArray[np.float64]

#: Frames in which more than this share of the markers is missing are left out.
MOST_MISSING = 0.2
# Without markers on bone, this share of all markers, the least moving, stands for it.
_HELD_SHARE = 0.15
_FEWEST_HELD = 4
# Evenly spread frames that tell which markers these are.
_ENOUGH_FRAMES = 2_000
# Markers that fit their places worse than this share of their spread were mixed up: faces differ by a tenth.
_LARGEST_MISFIT = 0.3
_BATCH = 32


@dataclass(frozen=True)
class MarkerReport:
    """What became of the motion.

    Attributes:
        n_frames: Frames in the file.
        used: Those that gave a mesh, counted from 0.
        gaps_filled: Positions of markers that were interpolated in time.
        completed: Positions that the other markers of the same frame had to tell.
        unused: Markers of the file that the map does not have.
        held: Markers by which the head's motion was taken out.
        neutral_frame: The frame taken for the relaxed face.
        scale: Units of the mesh per unit of the markers.
        misfit: Root mean square distance between markers and their places at rest, in units of the mesh: how far the
            two faces differ.
    """

    n_frames: int
    used: tuple[int, ...]
    gaps_filled: int
    completed: int
    unused: tuple[str, ...]
    held: tuple[str, ...]
    neutral_frame: int
    scale: float
    misfit: float

    @property
    def left_out(self) -> int:
        """Number of frames in which too many markers were missing."""
        return self.n_frames - len(self.used)


class MarkerMeshes:
    """The meshes of a motion, made while one iterates, in the order of ``report.used``; each (N, 3)."""

    def __init__(self, deformer: MarkerDeformer, displacements: Array, report: MarkerReport) -> None:
        """Take what ``meshes_from_markers`` found: ``displacements`` of shape (F, H, 3), NaN where unknown."""
        self.deformer = deformer
        self.displacements = displacements
        self.report = report

    def __len__(self) -> int:
        return len(self.displacements)

    def __iter__(self) -> Iterator[Array]:
        for start in range(0, len(self), _BATCH):
            yield from self.deformer.displaced(self.displacements[start : start + _BATCH])


def meshes_from_markers(
    motion: MarkerMotion,
    marker_map: MarkerMap,
    vertices: Floats,
    triangles: Ints,
    feature_points: Mapping[str, int] | None = None,
) -> MarkerMeshes:
    """Return the meshes that follow a motion, with the head at rest.

    Short gaps are filled in time. Each frame is moved rigidly so that the markers on bone, or else those that move
    least, are where they are in the neutral frame. One similarity takes the neutral frame's markers to their places on
    the mesh; turned and scaled by it, only the displacements from the neutral frame reach the mesh, so that the face
    may have other proportions than the performer's.

    Args:
        motion: The markers, in any units and orientation.
        marker_map: Their places on the mesh.
        vertices: The mesh at rest, shape (N, 3).
        triangles: Its vertex ids, shape (T, 3).
        feature_points: Vertex id by feature point, if the map uses them.

    Raises:
        FacePoserError: If the map does not fit the motion or the mesh.
    """
    source = marker_map.source
    check_names(motion, marker_map)
    points = marker_map.surface_points(vertices, triangles, feature_points)
    try:
        deformer = MarkerDeformer(vertices, triangles, points)
    except ValueError as error:
        raise FacePoserError(f"The marker map '{source}' cannot be used: {error}; move one.") from None

    still, report = displacements_of_markers(motion, marker_map, deformer.places)
    return MarkerMeshes(deformer, still[np.array(report.used, dtype=np.intp)], report)


def displacements_of_markers(
    motion: MarkerMotion, marker_map: MarkerMap, places: Array, find_held: bool = True
) -> tuple[Array, MarkerReport]:
    """Return how the mapped markers move on a mesh from the neutral frame on, with the head at rest.

    Args:
        motion: The markers, in any units and orientation.
        marker_map: Which of them lie where.
        places: Where that is on the mesh at rest, shape (H, 3).
        find_held: Whether the least moving markers stand for bone if the map names none; else the head is taken to
            be at rest then.

    Returns:
        Displacements in all frames, shape (F, H, 3), NaN where unknown; and what became of the motion.

    Raises:
        FacePoserError: If the map does not fit the motion or the places.
    """
    source = marker_map.source
    check_names(motion, marker_map)
    motion, gaps_filled = fill_gaps(motion)
    mapped = np.array([motion.names.index(name) for name in marker_map.places])
    fixed = np.array([motion.names.index(name) for name in marker_map.fixed], dtype=np.intp)
    neutral = _neutral_frame(motion, marker_map, np.concatenate([mapped, fixed]))
    reference = motion.positions[neutral]
    held = fixed
    if not len(fixed) and find_held:
        candidates = np.flatnonzero(motion.seen[neutral])
        held = _least_moving(motion.positions[:, candidates], reference[candidates], candidates)
    still, can_hold = motion.positions, np.ones(len(motion.positions), dtype=bool)
    if len(held):
        if not determines_rotation(reference[held]):
            raise FacePoserError(f"The markers that hold the head in '{source}' are on a line; name others as fixed.")
        still, can_hold = _at_rest(motion.positions, reference, held)

    if not (determines_rotation(reference[mapped]) and determines_rotation(places)):
        raise FacePoserError(f"The markers in '{source}' are fewer than three, or all on a line; map more of them.")
    fit = rigid_alignment(reference[mapped], places, scale=True)
    misfit = _rms(fit.apply(reference[mapped]) - places)
    if misfit > _LARGEST_MISFIT * _rms(places - places.mean(axis=0)):
        raise FacePoserError(
            f"The markers do not lie as '{source}' says (they are {misfit:.3g} off on average); check the names, left "
            "and right, and the neutral frame."
        )
    seen = np.asarray(np.isfinite(still[:, mapped]).all(axis=2))
    used = np.flatnonzero(can_hold & (seen.mean(axis=1) >= 1.0 - MOST_MISSING))
    report = MarkerReport(
        n_frames=len(motion.positions),
        used=tuple(int(frame) for frame in used),
        gaps_filled=gaps_filled,
        completed=int((~seen[used]).sum()),
        unused=tuple(name for name in motion.names if name not in marker_map.places and name not in marker_map.fixed),
        held=tuple(motion.names[i] for i in held),
        neutral_frame=neutral,
        scale=float(fit.scale),
        misfit=misfit,
    )
    return fit.apply_to_directions(still[:, mapped] - reference[mapped]), report


def check_names(motion: MarkerMotion, marker_map: MarkerMap) -> None:
    """Raise ``FacePoserError`` unless all markers of the map are some of the motion."""
    for name in (*marker_map.places, *marker_map.fixed):
        if name not in motion.names:
            known = ", ".join(motion.names[:5]) + (", ..." if len(motion.names) > 5 else "")
            raise FacePoserError(
                f"The marker map '{marker_map.source}' has {name}, which is no marker of the motion ({known})."
            )


def _neutral_frame(motion: MarkerMotion, marker_map: MarkerMap, needed: NDArray[np.intp]) -> int:
    source = marker_map.source
    complete = np.asarray(motion.seen[:, needed].all(axis=1))
    frame = marker_map.neutral_frame
    if frame is None:
        if not complete.any():
            rare = motion.names[needed[np.argmin(motion.seen[:, needed].mean(axis=0))]]
            raise FacePoserError(
                f"No frame has all markers of '{source}'; {rare} is seen least: take it out of the map."
            )
        return int(np.argmax(complete))
    if frame >= len(complete):
        raise FacePoserError(f"The neutral frame of '{source}' is {frame}, but the motion has {len(complete)} frames.")
    if not complete[frame]:
        lacking = ", ".join(motion.names[i] for i in needed if not motion.seen[frame, i])
        raise FacePoserError(f"The neutral frame {frame} of '{source}' lacks {lacking}; choose one with all markers.")
    return frame


def _least_moving(positions: Array, reference: Array, ids: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the ``ids`` of the markers that move least against each other: a trimmed fit, repeated until it stays."""
    count = min(len(ids), max(_FEWEST_HELD, round(_HELD_SHARE * len(ids))))
    chosen = np.arange(len(ids))
    positions = positions[:: max(1, len(positions) // _ENOUGH_FRAMES)]
    for _ in range(20):
        still, can_hold = _at_rest(positions, reference, chosen)
        squared = np.sum((still[can_hold] - reference) ** 2, axis=2)
        known = np.asarray(np.isfinite(squared))
        moving = np.where(known, squared, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        moving[~known.any(axis=0)] = np.inf
        best = np.sort(np.argsort(moving, kind="stable")[:count])
        if np.array_equal(best, chosen) or not determines_rotation(reference[best]):
            break
        chosen = best
    return ids[chosen]


def _at_rest(positions: Array, reference: Array, held: NDArray[np.intp]) -> tuple[Array, NDArray[np.bool_]]:
    """Return all frames with the ``held`` markers on their places in ``reference``, and which could be moved so."""
    seen = np.asarray(np.isfinite(positions[:, held]).all(axis=2))
    # Both sets must tell a rotation by the markers that the frame has.
    told = determines_rotation(positions[:, held]) & determines_rotation(reference[held], seen.astype(np.float64))
    still = np.full_like(positions, np.nan)
    if told.any():
        still[told] = rigid_alignment(positions[told][:, held], reference[held]).apply(positions[told])
    return still, np.asarray(told)


def _rms(offsets: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(offsets**2, axis=-1))))
