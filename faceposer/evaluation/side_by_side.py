"""Rendered faces side by side: the truth, our method, and the best other method (Figures 17 to 21)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw, ImageFont

from faceposer.evaluation.measures import Score
from faceposer.evaluation.methods.method import prepared
from faceposer.evaluation.methods.registry import METHODS
from faceposer.evaluation.rows import Row
from faceposer.evaluation.running import unavailable
from faceposer.evaluation.setting import StudyContext
from faceposer.evaluation.study import Outcome, Study
from faceposer.evaluation.tables import targets
from faceposer.evaluation.trials import Cell, Trial, TrialMaker
from faceposer.render.images import write_png
from faceposer.render.offscreen import render_character
from faceposer.resources import fonts_folder
from faceposer.solve.constraints.distance import DistanceConstraint
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.constraints.stroke import StrokeConstraint

#: Priors of the program, which do not count as other methods.
OURS = ("mfa", "mfa-whole", "mfa-undamped")
# Informative numbers of constraints: enough to define the face, and not so many that all methods agree.
_INFORMATIVE_COUNTS = {"point": 8, "distance": 4, "stroke": 450}
# Largest 2D error that is not visible, in pixels.
_INVISIBLE_PX = 0.5
_PANEL, _GAP, _LINE, _FONT = 520, 8, 26, 19
_PAPER, _INK = (255, 255, 255), (20, 20, 20)
# Targets in orange, points of the face in blue; all common kinds of colour vision distinguish them.
_TARGET, _POINT = (230, 120, 0), (0, 90, 200)


def write_pictures(study: Study, outcome: Outcome) -> list[Path]:
    """Render one trial of each kind of constraint, and one unnatural result, into the study's folder.

    The trial has the median of our relative errors in its cell, so that it is neither our best nor our worst; the other
    method is the one with the lowest error in the cell. The last image shows the trial in which another method
    satisfies its constraints and is farthest from all real frames.

    Returns:
        Paths of the images.

    Raises:
        FacePoserError: If the system has no OpenGL, or a file cannot be written.
    """
    setting, frames = study.source.load()
    sheet = _Sheet(setting, frames, study, outcome)
    written = []
    for cell in _informative_cells(outcome.rows):
        ours, other = _pair(outcome.rows, cell)
        if ours is not None and other is not None:
            relative = {key: score.error / score.neutral_error for key, score in sheet.scores(ours, cell).items()}
            median = sorted(relative, key=lambda key: relative[key])[(len(relative) - 1) // 2]
            written.append(sheet.draw(f"faces-{cell.constraint}", cell, median, (ours, other)))
    unnatural = _unnatural(sheet, study)
    if unnatural is not None:
        cell, key, ours, other = unnatural
        written.append(sheet.draw("faces-unnatural", cell, key, (ours, other)))
    return written


Key = tuple[int, int]


def _informative_cells(rows: Sequence[Row]) -> list[Cell]:
    """Return a cell of each kind at the first noise level, with the number of constraints closest to informative."""
    cells = []
    for kind, informative in _INFORMATIVE_COUNTS.items():
        of_kind = [row for row in rows if row["constraint"] == kind and "region" not in row]
        if of_kind:
            row = min(
                of_kind, key=lambda row: (row["noise_px"] != rows[0]["noise_px"], abs(row["count"] - informative))
            )
            cells.append(Cell(kind, row["count"], row["noise_px"]))
    return cells


def _pair(rows: Sequence[Row], cell: Cell) -> tuple[str | None, str | None]:
    """Return the first of our methods and the best of the others in ``cell``, None if there is none."""
    of_cell = [
        row
        for row in rows
        if (row["constraint"], row["count"], row["noise_px"], row.get("region"))
        == (cell.constraint, cell.count, cell.noise_px, cell.region)
    ]
    ours = next((row["method"] for row in of_cell if row["method"] in OURS), None)
    others = [row for row in of_cell if row["method"] not in OURS]
    best = min(others, key=lambda row: row["error_3d_relative"], default=None)
    return ours, best["method"] if best is not None else None


def _unnatural(sheet: "_Sheet", study: Study) -> tuple[Cell, Key, str, str] | None:
    """Return the trial in which another method satisfies its constraints and is farthest from real frames.

    Returns:
        Its cell and key, and both methods; None if there is no such trial.
    """
    ours = next((name for name in study.plan.methods if name in OURS), None)
    found: tuple[float, Cell, Key, str] | None = None
    for cell in study.plan.cells:
        # Exact targets only, so that noise is not the cause.
        if ours is None or cell.noise_px > 0.0 or cell.region is not None or cell.constraint == "stroke":
            continue
        for name in study.plan.methods:
            for key, score in sheet.scores(name, cell).items() if name not in OURS else ():
                # Far larger errors only show a torn mesh.
                eligible = score.error_2d_px < _INVISIBLE_PX and score.error < 3.0 * score.neutral_error
                if eligible and key in sheet.scores(ours, cell) and (found is None or score.to_real > found[0]):
                    found = (score.to_real, cell, key, name)
    return None if found is None or ours is None else (*found[1:3], ours, found[3])


class _Sheet:
    """Renderer of trials."""

    def __init__(self, setting: StudyContext, frames: NDArray[np.float64], study: Study, outcome: Outcome) -> None:
        self._setting, self._frames, self._study, self._outcome = setting, frames, study, outcome
        self._maker = TrialMaker(setting)
        self._font = ImageFont.truetype(str(fonts_folder() / "Roboto" / "Roboto-Regular.ttf"), _FONT)

    def scores(self, method: str, cell: Cell) -> dict[Key, Score]:
        """Return the scores of ``method`` in ``cell``, keyed by seed and number of the trial."""
        count = self._study.plan.n_trials(method, cell)
        return {
            (seed, number): score
            for seed in self._study.plan.seeds
            for number, score in self._outcome.scores.get((method, cell, seed), {}).items()
            if number < count
        }

    def draw(self, name: str, cell: Cell, key: Key, methods: Sequence[str]) -> Path:
        """Render the trial ``key`` of ``cell`` to a file, and return its path."""
        seed, number = key
        trial = list(self._maker.trials(cell, self._frames, number + 1, seed))[number]
        truth = self._setting.shown(self._setting.vertices_of(trial.weights))
        panels = [(f"{cell.words}, {targets(cell.noise_px)}", f"truth (trial {number}, seed {seed})", truth)]
        for method_name in methods:
            if unavailable(method_name) is None:
                method, score = prepared(METHODS[method_name], self._setting), self.scores(method_name, cell)[key]
                vertices = self._setting.shown(method.vertices(method.solve(trial.constraints)))
                errors = (
                    f"3D error {score.error / score.neutral_error:.2f} (neutral 1), 2D {score.error_2d_px:.1f} px, "
                    f"to real {score.to_real:.2f}"
                )
                panels.append((method_name, errors, vertices))
        height = _PANEL + 2 * _LINE + _GAP
        sheet = Image.new("RGB", (len(panels) * (_PANEL + _GAP) - _GAP, height), _PAPER)
        for i, (title, errors, vertices) in enumerate(panels):
            left = i * (_PANEL + _GAP)
            sheet.paste(self._face(vertices, trial), (left, 0))
            pen = ImageDraw.Draw(sheet)
            for line, text in enumerate((title, errors)):
                pen.text((left + 6, _PANEL + 4 + line * _LINE), text, _INK, self._font)
        path = self._study.folder / f"{name}.png"
        write_png(path, np.asarray(sheet))
        return path

    def _face(self, vertices: ArrayLike, trial: Trial) -> Image.Image:
        image = Image.fromarray(render_character(self._setting.character, vertices, self._setting.camera))
        pen = ImageDraw.Draw(image)
        for constraint in trial.constraints:
            self._mark(pen, constraint, vertices)
        return image.resize((_PANEL, _PANEL), Image.Resampling.LANCZOS)

    def _mark(self, pen: ImageDraw.ImageDraw, constraint: Constraint, vertices: ArrayLike) -> None:
        """Draw the target of ``constraint``, and its points on the face with ``vertices``."""
        if not isinstance(constraint, PointConstraint | DistanceConstraint | StrokeConstraint):
            return
        points = constraint.points.positions(np.asarray(vertices, dtype=np.float64), self._setting.character.triangles)
        pixels = [(float(u), float(v)) for u, v in constraint.camera.project(points)]
        if isinstance(constraint, StrokeConstraint):
            for pixel in pixels[::4]:
                _dot(pen, pixel, 1.5, _POINT)
            pen.line([(float(u), float(v)) for u, v in constraint.target], _TARGET, 3)
        elif isinstance(constraint, PointConstraint):
            pen.line([pixels[0], constraint.target], _TARGET, 3)
            _ring(pen, constraint.target, 7.0, _TARGET)
            _dot(pen, pixels[0], 4.0, _POINT)
        else:
            pen.line(pixels, _POINT, 2)
            # The target length, with the same centre and direction.
            (u, v), half = np.mean(pixels, axis=0), np.subtract(pixels[1], pixels[0])
            half = 0.5 * constraint.target * half / max(float(np.hypot(*half)), 1e-9)
            for side in (-1.0, 1.0):
                _ring(pen, (u + side * half[0], v + side * half[1]), 6.0, _TARGET)


def _dot(pen: ImageDraw.ImageDraw, at: Sequence[float], radius: float, colour: tuple[int, int, int]) -> None:
    pen.ellipse((at[0] - radius, at[1] - radius, at[0] + radius, at[1] + radius), fill=colour)


def _ring(pen: ImageDraw.ImageDraw, at: Sequence[float], radius: float, colour: tuple[int, int, int]) -> None:
    pen.ellipse((at[0] - radius, at[1] - radius, at[0] + radius, at[1] + radius), outline=colour, width=3)
