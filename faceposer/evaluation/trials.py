"""Trials from an unseen take: constraints sampled from a frame, and the frame itself as the truth."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from faceposer.evaluation.feature_lines import FEATURE_LINES, feature_line, width_of
from faceposer.evaluation.setting import StudyContext
from faceposer.geometry.mesh import VertexNormals
from faceposer.geometry.picking import SurfacePoints
from faceposer.geometry.strokes import resampled, smoothed
from faceposer.model.character import Character
from faceposer.solve.constraints.distance import DistanceConstraint
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.constraints.stroke import StrokeConstraint, as_pixels

Array = NDArray[np.float64]

#: Default numbers of constraints by kind; for strokes, numbers of pixels.
COUNTS: dict[str, tuple[int, ...]] = {
    "point": (1, 2, 4, 8, 16, 32),
    "distance": (1, 2, 4, 8),
    "stroke": (150, 300, 450, 900),
}
#: The character's regions that form each region of the evaluation; together, the face without ears and neck.
FACE_REGIONS: dict[str, tuple[str, ...]] = {
    "brows": ("brow_left", "brow_right", "forehead"),
    "lids": ("lids_left", "lids_right", "eye_left", "eye_right"),
    "midface": ("nose", "cheek_left", "cheek_right"),
    "mouth": ("mouth", "lip_upper", "lip_lower", "jaw"),
}
#: Feature lines along which strokes are drawn, by region.
STROKE_LINES = {"mouth": ("lip_upper", "lip_lower"), "brows": ("brow_left", "brow_right")}
# Smallest motion in pixels, relative to the neutral face, for constraints on points, distances and lines.
_POINT_MOTION, _DISTANCE_CHANGE, _LINE_MOTION = 1.0, 2.0, 3.0
# Number and share of candidate places that must move in a frame, so that it shows an expression.
_MIN_MOVING, _MIN_MOVING_SHARE = 100, 0.25
# Distance between the points along a line, in pixels.
_STEP = 4.0


@dataclass(frozen=True)
class Cell:
    """A cell of the table: the condition that its trials have in common.

    Attributes:
        constraint: "point", "distance" or "stroke".
        count: Number of points or distances in a trial, or pixels of its stroke.
        noise_px: Standard deviation of the target noise, in pixels.
        region: The only region of ``FACE_REGIONS`` with constraints, or None for the whole face.
    """

    constraint: str
    count: int
    noise_px: float
    region: str | None = None

    @property
    def words(self) -> str:
        """Description of the constraints."""
        where = f" within the {self.region}" if self.region is not None else ""
        if self.constraint == "stroke":
            return f"a stroke of {self.count} pixels{where}"
        return f"{self.count} {self.constraint}{'s' if self.count > 1 else ''}{where}"


@dataclass(frozen=True, eq=False)
class Trial:
    """One trial.

    Attributes:
        constraints: Input of a method.
        weights: Rig weights of the frame from which they were sampled, shape (S,).
    """

    constraints: tuple[Constraint, ...]
    weights: Array


class TrialMaker:
    """Maker of trials on one face; they depend on its geometry only, not on a prior."""

    def __init__(self, setting: StudyContext) -> None:
        """Initialise for the face and the camera of ``setting``."""
        self._setting = setting

    @cached_property
    def regions(self) -> dict[str, NDArray[np.intp]]:
        """Vertex indices of each of ``FACE_REGIONS`` that the character has."""
        return region_vertices(self._setting.character)

    @cached_property
    def _visible(self) -> NDArray[np.intp]:
        return visible_vertices(self._setting)

    def places(self, cell: Cell) -> NDArray[np.intp]:
        """Return the vertices from which the trials of ``cell`` are sampled."""
        if cell.constraint == "distance":
            features = np.array(sorted(self._setting.character.feature_points.values()), dtype=np.intp)
            # Feature points are on edges and in corners, where a strict test of visibility would exclude many.
            places = features if len(features) >= 4 else self._visible[::30]
        elif cell.region == "brows":
            places = self._visible
        else:
            # Every vertex of the small brows is a candidate, elsewhere every third.
            places = self._visible[::3]
        if cell.region is not None:
            places = places[np.isin(places, self.regions[cell.region])]
        return places

    def lacking(self, cell: Cell) -> str | None:
        """Return a sentence with the reason if the face has no places for the constraints of ``cell``, else None."""
        where = f" within the {cell.region}" if cell.region is not None else ""
        name = self._setting.character.name
        if cell.constraint == "stroke":
            if self._line_names(cell):
                return None
            return f"'{name}' has no feature points for a stroke{where}."
        places = len(self.places(cell))
        distance = cell.constraint == "distance"
        if (places * (places - 1) // 2 if distance else places) >= cell.count:
            return None
        return f"'{name}' has too few {'feature points' if distance else 'vertices'} for {cell.words}: {places}."

    def trials(self, cell: Cell, frames: Array, poses: int, seed: int) -> Iterator[Trial]:
        """Yield up to ``poses`` trials of ``cell``, fewer if too few frames have enough motion.

        Args:
            cell: The cell.
            frames: Rig weights of the unseen take, shape (F, S).
            poses: Largest number of trials.
            seed: Seed of frames, places and noise.
        """
        kinds = list(COUNTS)
        regions = [None, *FACE_REGIONS]
        rng = np.random.default_rng([seed, kinds.index(cell.constraint), cell.count, regions.index(cell.region)])
        make = {"point": self._points, "distance": self._distances, "stroke": self._strokes}[cell.constraint]
        return make(cell, frames, poses, rng)

    def _random_frames(
        self, frames: Array, vertices: Sequence[int], rng: np.random.Generator
    ) -> Iterator[tuple[int, Array]]:
        """Yield the frames in random order, with the pixels of ``vertices`` in each, shape (n, 2)."""
        character, camera = self._setting.character, self._setting.camera
        ids = np.asarray(vertices, dtype=np.intp)
        shapes = np.ascontiguousarray(character.shapes[:, ids], dtype=np.float64)
        for frame in rng.permutation(len(frames)):
            yield int(frame), camera.project(character.vertices[ids] + np.tensordot(frames[frame], shapes, axes=1))

    def _points(self, cell: Cell, frames: Array, poses: int, rng: np.random.Generator) -> Iterator[Trial]:
        setting = self._setting
        places = self.places(cell)
        rest = setting.camera.project(setting.character.vertices[places])
        enough = int(_MIN_MOVING_SHARE * len(places))
        if cell.region is None:
            enough = min(_MIN_MOVING, enough)
        done = 0
        for frame, pixels in self._random_frames(frames, places.tolist(), rng):
            moving = np.flatnonzero(np.hypot(*(pixels - rest).T) > _POINT_MOTION)
            if len(moving) < max(enough, cell.count):
                continue
            chosen = rng.choice(moving, cell.count, replace=False)
            targets = pixels[chosen] + cell.noise_px * rng.standard_normal((cell.count, 2))
            yield Trial(
                tuple(
                    PointConstraint(int(places[i]), (float(u), float(v)), setting.camera)
                    for i, (u, v) in zip(chosen, targets, strict=True)
                ),
                frames[frame],
            )
            done += 1
            if done == poses:
                return

    def _distances(self, cell: Cell, frames: Array, poses: int, rng: np.random.Generator) -> Iterator[Trial]:
        setting = self._setting
        places = self.places(cell)
        first, second = np.triu_indices(len(places), 1)
        rest = setting.camera.project(setting.character.vertices[places])
        neutral_lengths = np.hypot(*(rest[first] - rest[second]).T)
        done = 0
        for frame, pixels in self._random_frames(frames, places.tolist(), rng):
            lengths = np.hypot(*(pixels[first] - pixels[second]).T)
            changed = np.flatnonzero(np.abs(lengths - neutral_lengths) > _DISTANCE_CHANGE)
            if len(changed) < max(cell.count, _MIN_MOVING_SHARE * len(places)):
                continue
            chosen = rng.choice(changed, cell.count, replace=False)
            targets = np.maximum(lengths[chosen] + cell.noise_px * rng.standard_normal(cell.count), 0.0)
            yield Trial(
                tuple(
                    DistanceConstraint((int(places[first[i]]), int(places[second[i]])), float(length), setting.camera)
                    for i, length in zip(chosen, targets, strict=True)
                ),
                frames[frame],
            )
            done += 1
            if done == poses:
                return

    @cached_property
    def _lines(self) -> dict[str, tuple[SurfacePoints, Array, Array]]:
        """Surface points along each feature line, their pixels, and the pixels of the whole line, by name."""
        setting, model, lines = self._setting, self._setting.full, {}
        for name in (name for names in STROKE_LINES.values() for name in names):
            if not set(FEATURE_LINES[name]) <= setting.character.feature_points.keys():
                continue
            line = feature_line(model, setting.character.vertices, setting.camera, FEATURE_LINES[name])
            pixels = resampled(line, _STEP)
            points, hit = model.pick(model.neutral(), setting.camera, pixels)
            if hit.any():
                lines[name] = (points, pixels[hit], pixels)
        return lines

    def _line_names(self, cell: Cell) -> list[str]:
        """Return the lines along which the strokes of ``cell`` are drawn."""
        regions = STROKE_LINES if cell.region is None else (cell.region,)
        return [name for region in regions for name in STROKE_LINES.get(region, ()) if name in self._lines]

    def _strokes(self, cell: Cell, frames: Array, poses: int, rng: np.random.Generator) -> Iterator[Trial]:
        setting, model = self._setting, self._setting.full
        names = self._line_names(cell)
        if not names:
            return
        sources = {}
        for name in names:
            _, _, path = self._lines[name]
            stroke = StrokeConstraint(as_pixels(path), as_pixels(path), width_of(path, cell.count), setting.camera)
            sources[name] = stroke.resolved(model, model.neutral())
        done = 0
        for frame in rng.permutation(len(frames)):
            # The lines take turns, each with the next frame in which it moves.
            name = names[done % len(names)]
            points, rest, _ = self._lines[name]
            line = setting.camera.project(points.positions(setting.vertices_of(frames[frame]), model.triangles))
            if np.hypot(*(line - rest).T).mean() < _LINE_MOTION:
                continue
            if cell.noise_px > 0:
                line = smoothed(line + cell.noise_px * rng.standard_normal(line.shape))
            yield Trial((replace(sources[name], target=as_pixels(line)),), frames[frame])
            done += 1
            if done == poses:
                return


def region_vertices(character: Character) -> dict[str, NDArray[np.intp]]:
    """Return the vertex indices of each of ``FACE_REGIONS`` of which ``character`` has a part, each of shape (n,)."""
    found = {}
    for name, parts in FACE_REGIONS.items():
        present = [character.regions[part] for part in parts if part in character.regions]
        if present:
            found[name] = np.unique(np.concatenate(present)).astype(np.intp)
    return found


def skin_vertices(character: Character) -> NDArray[np.intp]:
    """Return the vertices of the parts with skin material, shape (n,), or all vertices if there are none."""
    runs = [np.arange(*part.vertices) for part in character.parts if part.material == "skin"]
    return np.concatenate(runs).astype(np.intp) if runs else np.arange(len(character.vertices), dtype=np.intp)


def visible_vertices(setting: StudyContext) -> NDArray[np.intp]:
    """Return the skin vertices of the neutral face that are visible to the camera and face it, shape (n,)."""
    character, camera = setting.character, setting.camera
    vertices = character.vertices
    normals = VertexNormals(character.triangles, len(vertices))(vertices)
    towards = camera.center - vertices
    facing = np.einsum("nd,nd->n", normals, towards) > 0.2 * np.linalg.norm(towards, axis=1)
    skin = skin_vertices(character)
    candidates = skin[facing[skin]]
    points, hit = setting.full.pick(setting.full.neutral(), camera, camera.project(vertices[candidates]))
    visible = candidates[hit]
    # For a hidden vertex, the picked point is in front of it.
    offsets = points.positions(vertices, character.triangles) - vertices[visible]
    return visible[np.linalg.norm(offsets, axis=1) < 0.02 * character.height]
