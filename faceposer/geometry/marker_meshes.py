"""Conversion of the motion of markers to a mesh for each frame (section 3.1 of the paper)."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.geometry.alignment import determines_rotation, rigid_alignment
from faceposer.geometry.deform import MarkerDeformer
from faceposer.geometry.marker_io import MarkerMotion, fill_gaps
from faceposer.geometry.marker_map import MarkerMap
from faceposer.geometry.mesh import Floats, Ints

Array = NDArray[np.float64]

#: Largest share of missing markers in a frame; frames with more are left out.
MOST_MISSING = 0.2
# Share of all markers, those that move least, that is used if no markers are rigidly attached to the skull.
_HELD_SHARE = 0.15
_FEWEST_HELD = 4
# Number of evenly spaced frames from which these markers are determined.
_ENOUGH_FRAMES = 2_000
# Largest misfit of markers and their places, as a share of their spread, beyond which they were mixed up. Faces differ
# by about a tenth.
_LARGEST_MISFIT = 0.3
_BATCH = 32


@dataclass(frozen=True)
class MarkerReport:
    """Report on the conversion of a motion.

    Attributes:
        n_frames: Number of frames in the file.
        used: Indices, from 0, of the frames that were converted to meshes.
        gaps_filled: Number of marker positions that were interpolated in time.
        completed: Number of marker positions that were inferred from the other markers of the same frame.
        unused: Markers of the file that are not in the map.
        held: Markers by which the motion of the head was removed.
        neutral_frame: Index of the frame used as the relaxed face.
        scale: Units of the mesh per unit of the markers.
        misfit: Root mean square distance between markers and their places at rest, in units of the mesh, due to the
            difference of the two faces.
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
    """Iterable over the meshes of a motion, shape (N, 3) each, in the order of ``report.used``."""

    def __init__(self, deformer: MarkerDeformer, displacements: Array, report: MarkerReport) -> None:
        """Initialise from the handles' ``displacements``, shape (F, H, 3), NaN if unknown."""
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

    Short gaps are filled in time. Each frame is aligned rigidly with the neutral frame by the markers on the skull, or
    else those that move least. A single similarity transform maps the neutral frame's markers to their places on the
    mesh. Only displacements from the neutral frame, rotated and scaled by it, are transferred to the mesh, so that its
    proportions may differ from the performer's.

    Args:
        motion: Motion of the markers, in any unit and orientation.
        marker_map: Places of the markers on the mesh.
        vertices: Vertices of the mesh at rest, shape (N, 3).
        triangles: Vertex ids, shape (T, 3).
        feature_points: Vertex id by feature point, if the map uses them.

    Raises:
        FacePoserError: If the map does not match the motion or the mesh.
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
    """Return the displacements of the mapped markers on a mesh from the neutral frame, with the head at rest.

    Args:
        motion: Motion of the markers, in any unit and orientation.
        marker_map: Places of the markers on the mesh.
        places: Positions of these places on the mesh at rest, shape (H, 3).
        find_held: True to remove the motion of the head by the markers that move least if the map names no fixed ones;
            otherwise the head is then assumed to be at rest.

    Returns:
        Displacements in all frames, shape (F, H, 3), NaN if unknown, and the report.

    Raises:
        FacePoserError: If the map does not match the motion or the places.
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
    still, alignable = motion.positions, np.ones(len(motion.positions), dtype=bool)
    if len(held):
        if not determines_rotation(reference[held]):
            raise FacePoserError(f"The fixed markers of '{source}' are on a line; choose others as fixed.")
        still, alignable = _stabilised(motion.positions, reference, held)

    if not (determines_rotation(reference[mapped]) and determines_rotation(places)):
        raise FacePoserError(f"'{source}' has fewer than three markers, or all are on a line; add more markers.")
    fit = rigid_alignment(reference[mapped], places, scale=True)
    misfit = _rms(fit.apply(reference[mapped]) - places)
    if misfit > _LARGEST_MISFIT * _rms(places - places.mean(axis=0)):
        raise FacePoserError(
            f"The markers do not match '{source}' (the root mean square error is {misfit:.3g}); check the names, left "
            "and right, and the neutral frame."
        )
    seen = np.asarray(np.isfinite(still[:, mapped]).all(axis=2))
    used = np.flatnonzero(alignable & (seen.mean(axis=1) >= 1.0 - MOST_MISSING))
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
    """Raise ``FacePoserError`` unless the motion has all markers of the map."""
    for name in (*marker_map.places, *marker_map.fixed):
        if name not in motion.names:
            known = ", ".join(motion.names[:5]) + (", ..." if len(motion.names) > 5 else "")
            raise FacePoserError(
                f"The marker map '{marker_map.source}' has marker {name}, which is not in the motion ({known})."
            )


def _neutral_frame(motion: MarkerMotion, marker_map: MarkerMap, needed: NDArray[np.intp]) -> int:
    source = marker_map.source
    complete = np.asarray(motion.seen[:, needed].all(axis=1))
    frame = marker_map.neutral_frame
    if frame is None:
        if not complete.any():
            rare = motion.names[needed[np.argmin(motion.seen[:, needed].mean(axis=0))]]
            raise FacePoserError(
                f"No frame has all markers of '{source}'; remove {rare}, which is missing most often, from the map."
            )
        return int(np.argmax(complete))
    if frame >= len(complete):
        raise FacePoserError(
            f"The neutral frame of '{source}' is {frame}, but the motion has {counted(len(complete), 'frame')}."
        )
    if not complete[frame]:
        missing = ", ".join(motion.names[i] for i in needed if not motion.seen[frame, i])
        raise FacePoserError(f"The neutral frame {frame} of '{source}' lacks {missing}; choose one with all markers.")
    return frame


def _least_moving(positions: Array, reference: Array, ids: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the ``ids`` of the markers that move least relative to each other, by an iterated trimmed fit."""
    count = min(len(ids), max(_FEWEST_HELD, round(_HELD_SHARE * len(ids))))
    chosen = np.arange(len(ids))
    positions = positions[:: max(1, len(positions) // _ENOUGH_FRAMES)]
    for _ in range(20):
        still, alignable = _stabilised(positions, reference, chosen)
        squared = np.sum((still[alignable] - reference) ** 2, axis=2)
        known = np.asarray(np.isfinite(squared))
        moving = np.where(known, squared, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        moving[~known.any(axis=0)] = np.inf
        best = np.sort(np.argsort(moving, kind="stable")[:count])
        if np.array_equal(best, chosen) or not determines_rotation(reference[best]):
            break
        chosen = best
    return ids[chosen]


def _stabilised(positions: Array, reference: Array, held: NDArray[np.intp]) -> tuple[Array, NDArray[np.bool_]]:
    """Align all frames with ``reference`` by the ``held`` markers; return them and the mask of alignable frames."""
    seen = np.asarray(np.isfinite(positions[:, held]).all(axis=2))
    # The markers known in the frame must determine the rotation in both sets.
    determined = determines_rotation(positions[:, held]) & determines_rotation(reference[held], seen.astype(np.float64))
    still = np.full_like(positions, np.nan)
    if determined.any():
        fit = rigid_alignment(positions[determined][:, held], reference[held])
        still[determined] = fit.apply(positions[determined])
    return still, np.asarray(determined)


def _rms(offsets: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(offsets**2, axis=-1))))
