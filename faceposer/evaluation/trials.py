"""Tests made from an unseen take: constraints that a frame gives, and the frame itself."""

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

#: Kinds of constraints, with the numbers of them (pixels, of strokes) that are tried by default.
COUNTS: dict[str, tuple[int, ...]] = {
    "point": (1, 2, 4, 8, 16, 32),
    "distance": (1, 2, 4, 8),
    "stroke": (150, 300, 450, 900),
}
#: The character's regions that make up each region of the judgement; together they are the face without ears and neck.
FACE_REGIONS: dict[str, tuple[str, ...]] = {
    "brows": ("brow_left", "brow_right", "forehead"),
    "lids": ("lids_left", "lids_right", "eye_left", "eye_right"),
    "midface": ("nose", "cheek_left", "cheek_right"),
    "mouth": ("mouth", "lip_upper", "lip_lower", "jaw"),
}
#: Where strokes are drawn, by region.
STROKE_LINES = {"mouth": ("lip_upper", "lip_lower"), "brows": ("brow_left", "brow_right")}
# A constraint is taken where the frame asks for a change of more than so many pixels.
_POINT_MOVES, _DISTANCE_CHANGES, _LINE_MOVES = 1.0, 2.0, 3.0
# Frames must move so many of the places that may be chosen, so that there is an expression to find.
_ANCHORS_MOVE, _SHARE_MOVES = 100, 0.25
# Pixels between the points along a line.
_STEP = 4.0


@dataclass(frozen=True)
class Cell:
    """What the trials of one place in the table have in common.

    Attributes:
        constraint: "point", "distance" or "stroke".
        count: Points or distances of a trial, or pixels of its stroke.
        noise_px: Standard deviation of the hand, in pixels.
        region: The only region of ``FACE_REGIONS`` that has constraints, if given.
    """

    constraint: str
    count: int
    noise_px: float
    region: str | None = None

    @property
    def words(self) -> str:
        """Its constraints in words."""
        where = f" within the {self.region}" if self.region is not None else ""
        if self.constraint == "stroke":
            return f"a stroke of {self.count} pixels{where}"
        return f"{self.count} {self.constraint}{'s' if self.count > 1 else ''}{where}"


@dataclass(frozen=True, eq=False)
class Trial:
    """One test.

    Attributes:
        constraints: What a method sees.
        weights: Rig weights of the frame that they come from, shape (S,).
    """

    constraints: tuple[Constraint, ...]
    weights: Array


class TrialMaker:
    """Makes trials on one face; they depend on its geometry alone, on no prior."""

    def __init__(self, setting: StudyContext) -> None:
        """Look at the neutral face of the ``setting`` for places that its camera sees."""
        self._setting = setting

    @cached_property
    def regions(self) -> dict[str, NDArray[np.intp]]:
        """Vertex ids of each of ``FACE_REGIONS`` that the character has."""
        return region_vertices(self._setting.character)

    @cached_property
    def _visible(self) -> NDArray[np.intp]:
        return visible_vertices(self._setting)

    def places(self, cell: Cell) -> NDArray[np.intp]:
        """Return the vertices between which the trials of ``cell`` choose."""
        if cell.constraint == "distance":
            features = np.array(sorted(self._setting.character.feature_points.values()), dtype=np.intp)
            # Feature points lie on edges and in corners, half hidden: what faces the camera is seen well enough.
            places = features if len(features) >= 4 else self._visible[::30]
        elif cell.region == "brows":
            places = self._visible
        else:
            # Brows are small: every vertex of them is a candidate, elsewhere every third.
            places = self._visible[::3]
        if cell.region is not None:
            places = places[np.isin(places, self.regions[cell.region])]
        return places

    def lacking(self, cell: Cell) -> str | None:
        """Return a sentence where the face has no place for the constraints of ``cell``, else None."""
        where = f" within the {cell.region}" if cell.region is not None else ""
        name = self._setting.character.name
        if cell.constraint == "stroke":
            if self._names(cell):
                return None
            return f"'{name}' shows no line{where} that strokes could be drawn along, for want of feature points."
        places = len(self.places(cell))
        distance = cell.constraint == "distance"
        if (places * (places - 1) // 2 if distance else places) >= cell.count:
            return None
        return (
            f"'{name}' has no place for {cell.words}: of {'feature points' if distance else 'vertices'} to "
            f"choose from there are {places}."
        )

    def trials(self, cell: Cell, frames: Array, poses: int, seed: int) -> Iterator[Trial]:
        """Yield ``poses`` trials of a ``cell``, fewer if too few frames move enough.

        Args:
            cell: What is asked.
            frames: Rig weights of the unseen take, shape (F, S).
            poses: Number of trials at most.
            seed: Of frames, places and noise.
        """
        kinds = list(COUNTS)
        regions = [None, *FACE_REGIONS]
        rng = np.random.default_rng([seed, kinds.index(cell.constraint), cell.count, regions.index(cell.region)])
        make = {"point": self._points, "distance": self._distances, "stroke": self._strokes}[cell.constraint]
        return make(cell, frames, poses, rng)

    def _in_turn(self, frames: Array, vertices: Sequence[int], rng: np.random.Generator) -> Iterator[tuple[int, Array]]:
        """Yield random frames with the pixels of ``vertices`` in them, shape (n, 2)."""
        character, camera = self._setting.character, self._setting.camera
        ids = np.asarray(vertices, dtype=np.intp)
        shapes = np.ascontiguousarray(character.shapes[:, ids], dtype=np.float64)
        for frame in rng.permutation(len(frames)):
            yield int(frame), camera.project(character.vertices[ids] + np.tensordot(frames[frame], shapes, axes=1))

    def _points(self, cell: Cell, frames: Array, poses: int, rng: np.random.Generator) -> Iterator[Trial]:
        setting = self._setting
        places = self.places(cell)
        rest = setting.camera.project(setting.character.vertices[places])
        enough = int(_SHARE_MOVES * len(places))
        if cell.region is None:
            enough = min(_ANCHORS_MOVE, enough)
        done = 0
        for frame, pixels in self._in_turn(frames, places.tolist(), rng):
            moving = np.flatnonzero(np.hypot(*(pixels - rest).T) > _POINT_MOVES)
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
        at_rest = np.hypot(*(rest[first] - rest[second]).T)
        done = 0
        for frame, pixels in self._in_turn(frames, places.tolist(), rng):
            lengths = np.hypot(*(pixels[first] - pixels[second]).T)
            changed = np.flatnonzero(np.abs(lengths - at_rest) > _DISTANCE_CHANGES)
            if len(changed) < max(cell.count, _SHARE_MOVES * len(places)):
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
        """The points along each line that the face has, and the pixels of these and of the whole way."""
        setting, model, lines = self._setting, self._setting.full, {}
        for name in (name for names in STROKE_LINES.values() for name in names):
            if not set(FEATURE_LINES[name]) <= setting.character.feature_points.keys():
                continue
            line = feature_line(model, setting.character.vertices, setting.camera, FEATURE_LINES[name])
            way = resampled(line, _STEP)
            points, met = model.pick(model.neutral(), setting.camera, way)
            if met.any():
                lines[name] = (points, way[met], way)
        return lines

    def _names(self, cell: Cell) -> list[str]:
        """Return the lines between which the strokes of ``cell`` choose."""
        regions = STROKE_LINES if cell.region is None else (cell.region,)
        return [name for region in regions for name in STROKE_LINES.get(region, ()) if name in self._lines]

    def _strokes(self, cell: Cell, frames: Array, poses: int, rng: np.random.Generator) -> Iterator[Trial]:
        setting, model = self._setting, self._setting.full
        names = self._names(cell)
        if not names:
            return
        sources = {}
        for name in names:
            _, _, way = self._lines[name]
            stroke = StrokeConstraint(as_pixels(way), as_pixels(way), width_of(way, cell.count), setting.camera)
            sources[name] = stroke.resolved(model, model.neutral())
        done = 0
        for frame in rng.permutation(len(frames)):
            # One line after another, each from another frame in which it moves.
            name = names[done % len(names)]
            points, rest, _ = self._lines[name]
            line = setting.camera.project(points.positions(setting.vertices_of(frames[frame]), model.triangles))
            if np.hypot(*(line - rest).T).mean() < _LINE_MOVES:
                continue
            if cell.noise_px > 0:
                line = smoothed(line + cell.noise_px * rng.standard_normal(line.shape))
            yield Trial((replace(sources[name], target=as_pixels(line)),), frames[frame])
            done += 1
            if done == poses:
                return


def region_vertices(character: Character) -> dict[str, NDArray[np.intp]]:
    """Return the vertex ids of each of ``FACE_REGIONS`` of which the ``character`` has some part, each shape (n,)."""
    found = {}
    for name, parts in FACE_REGIONS.items():
        present = [character.regions[part] for part in parts if part in character.regions]
        if present:
            found[name] = np.unique(np.concatenate(present)).astype(np.intp)
    return found


def skin_vertices(character: Character) -> NDArray[np.intp]:
    """Return the vertices of the ``character``'s skin, shape (n,): its parts of that material, all if there is none."""
    runs = [np.arange(*part.vertices) for part in character.parts if part.material == "skin"]
    return np.concatenate(runs).astype(np.intp) if runs else np.arange(len(character.vertices), dtype=np.intp)


def visible_vertices(setting: StudyContext) -> NDArray[np.intp]:
    """Return the vertices of the skin, shape (n,), that the camera sees on the neutral face, well turned to it."""
    character, camera = setting.character, setting.camera
    vertices = character.vertices
    normals = VertexNormals(character.triangles, len(vertices))(vertices)
    towards = camera.center - vertices
    facing = np.einsum("nd,nd->n", normals, towards) > 0.2 * np.linalg.norm(towards, axis=1)
    skin = skin_vertices(character)
    candidates = skin[facing[skin]]
    points, met = setting.full.pick(setting.full.neutral(), camera, camera.project(vertices[candidates]))
    seen = candidates[met]
    # What is met first lies in front of a hidden vertex.
    offsets = points.positions(vertices, character.triangles) - vertices[seen]
    return seen[np.linalg.norm(offsets, axis=1) < 0.02 * character.height]
