"""Comparison of our solve with other techniques, trial by trial, and of the ratios of times with their targets."""

import os
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import approx_fprime, minimize

from faceposer.errors import FacePoserError
from faceposer.evaluation.methods.arap import Arap
from faceposer.evaluation.methods.handles import Handles
from faceposer.evaluation.methods.method import Method, ModelMethod, prepared
from faceposer.evaluation.methods.registry import METHODS
from faceposer.evaluation.setting import StudyContext
from faceposer.evaluation.trials import Cell, Trial, TrialMaker
from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.map_solver import RELATIVE_TOLERANCE, SLOPE_TOLERANCE, best_start, solve
from faceposer.solve.problem import PoseProblem
from faceposer.solve.term import PoseState, ResidualTerm
from faceposer.training.capture import read_capture
from faceposer.training.expressions import clean
from scripts.benchmarking.timing import Row, elapsed, row

RIVALS = ("pca", "ppca", "lwr", "opt-blend", "interp-all", "bounded-weights", "mfa-plain", "eos", "arap")
CELLS = (
    ("points-4", Cell("point", 4, 1.5)),
    ("points-8", Cell("point", 8, 1.5)),
    ("points-32", Cell("point", 32, 1.5)),
    ("stroke-450", Cell("stroke", 450, 1.5)),
    ("distances-4", Cell("distance", 4, 1.5)),
)
FINITE = "finite-difference"
# The same without any of our derivatives: no curvature for scaling, no predicted start.
FINITE_ALONE = "finite-difference-alone"
_TRAIN, _TEST = "alex_rom_3.csv", "alex_rom_4.csv"
_DIFFERENCE = 1e-7


@dataclass(frozen=True)
class Target:
    """Target of the ratio of two times.

    Attributes:
        above: Name of the row in the numerator.
        below: Name of the row in the denominator.
        limit: Minimum of the ratio, or its maximum if ``at_most``.
        at_most: True if the limit is a maximum.
    """

    above: str
    below: str
    limit: float
    at_most: bool = False


#: Targets for each kind of constraint for which both rows exist.
TARGETS = (
    Target(FINITE, "mfa", 15.0),
    Target(FINITE_ALONE, "mfa", 15.0),
    Target("mfa", "pca", 1.5, at_most=True),
    Target("arap", "mfa", 50.0),
    Target("opt-blend", "mfa", 5.0),
    Target("lwr", "mfa", 1.0),
    Target("bounded-weights", "mfa", 1.0),
)
#: Target for the whole mesh.
MESH_TARGET = Target("reconstruct", "basis-copy", 1.5, at_most=True)


class FiniteDifferences(PoseProblem):
    """The same energy with a gradient by forward differences, without the derivatives of the paper's appendix."""

    def energy_and_gradient(self, p: np.ndarray) -> tuple[float, np.ndarray]:
        """Return E(p) and its numerical gradient."""
        return self.energy(p), approx_fprime(p, self.energy, _DIFFERENCE)

    def energy(self, p: np.ndarray) -> float:
        """Return E(p), without gradients of terms that do not need them."""
        state: PoseState = self.state(p)
        total = 0.0
        for term in self.terms:
            if isinstance(term, ResidualTerm):
                residual = term.residual(state)
                total += float(term.weights @ (residual * residual))
            else:
                total += term.value_and_gradient(state)[0]
        return total


def solve_by_differences(model: FaceModel, constraints: Sequence[Constraint]) -> np.ndarray:
    """Solve from the neutral face with numerical gradients; the start costs the same, since it only needs energies."""
    start, _ = best_start(PoseProblem(model, constraints))
    return solve(FiniteDifferences(model, constraints), start).coefficients


def solve_by_differences_alone(model: FaceModel, constraints: Sequence[Constraint]) -> np.ndarray:
    """Solve by L-BFGS with numerical gradients from the start pose, in units of the prior's standard deviations."""
    problem = FiniteDifferences(model, constraints)
    scale = np.sqrt(model.subspace.variances.clip(1e-9))
    # Tolerances as in our solve.
    result = minimize(
        lambda scaled: problem.energy(problem.start + scale * scaled),
        np.zeros_like(scale),
        method="L-BFGS-B",
        options={
            "maxiter": 200,
            "maxfun": 1_000_000,
            "gtol": SLOPE_TOLERANCE,
            "ftol": RELATIVE_TOLERANCE,
            "maxcor": 20,
        },
    )
    return np.asarray(problem.start + scale * result.x, dtype=np.float64)


#: Solvers of our objective with numerical gradients, by name of the row.
DIFFERENCES = {FINITE: solve_by_differences, FINITE_ALONE: solve_by_differences_alone}


def rival_rows(character: str, trials: int, names: Iterable[str] = RIVALS) -> list[Row]:
    """Measure our solve and the rivals ``names`` from the neutral face; return no rows without FACEPOSER_CAPTURES.

    All learn from take 3; the trials are from take 4, with a target noise of 1.5 px. The methods solve each trial one
    after another in random order, so that other load affects all equally. Rows of the basis at the constrained points
    are gathered in advance, as while a pin is dragged. The errors must not be used for choices: take 4 is the test take
    of the evaluation.
    """
    folder = os.environ.get("FACEPOSER_CAPTURES")
    if not folder:
        print("rivals are skipped; set FACEPOSER_CAPTURES to the folder of the captures")
        return []
    setting = StudyContext.of(load_character(character), [read_capture(Path(folder) / _TRAIN)])
    frames = setting.rig_weights(clean(read_capture(Path(folder) / _TEST), setting.recipe))
    methods: dict[str, Method] = {"mfa": prepared(METHODS["mfa"], setting)}
    for name in names:
        try:
            methods[name] = prepared(METHODS[name], setting)
        except FacePoserError as error:
            print(f"without {name}: {error}")
    maker = TrialMaker(setting)
    rows = []
    for label, cell in CELLS:
        # One additional trial: the first includes one-time loading and does not count.
        given = list(maker.trials(cell, frames, trials + 1, 0))
        able = {name: method for name, method in methods.items() if cell.constraint in method.kinds}
        rows += _compared(label, setting, able, given)
    return rows


def _compared(label: str, setting: StudyContext, methods: dict[str, Method], trials: Sequence[Trial]) -> list[Row]:
    rng = np.random.default_rng(0)
    times: dict[str, list[float]] = {name: [] for name in (*methods, *DIFFERENCES)}
    errors: dict[str, list[float]] = {name: [] for name in methods}
    neutral: list[float] = []
    alone: list[float] = []
    for trial in trials:
        truth = setting.vertices_of(trial.weights)
        neutral.append(float(np.linalg.norm(setting.character.vertices - truth, axis=1).mean()))
        for method in methods.values():
            if isinstance(method, ModelMethod):
                for constraint in trial.constraints:
                    method.model.jacobian_at(constraint.points)
        names = list(times)
        for name in (names[i] for i in rng.permutation(len(names))):
            if name in DIFFERENCES:
                solver = DIFFERENCES[name]
                times[name].append(elapsed(lambda given=trial, by=solver: by(setting.model, given.constraints)))  # type: ignore[misc]
                continue
            began = time.perf_counter()
            found = methods[name].solve(trial.constraints)
            times[name].append((time.perf_counter() - began) * 1e3)
            errors[name].append(float(np.linalg.norm(methods[name].vertices(found) - truth, axis=1).mean()))
            if name == "arap":
                alone.append(_without_factors(methods[name], setting, trial))
    mean = float(np.mean(neutral[1:]))
    rows = []
    for name, values in times.items():
        data = row(f"rivals/{label}/{name}", values[1:])
        if name in errors:
            data["error_3d_relative"] = round(float(np.mean(errors[name][1:])) / mean, 4)
        rows.append(data)
    return [*rows, row(f"rivals/{label}/arap-factorised", alone[1:])] if alone else rows


def _without_factors(method: Method, setting: StudyContext, trial: Trial) -> float:
    """Return the time of as-rigid-as-possible deformation with the handles of the previous solve."""
    assert isinstance(method, Arap)
    ids, targets = method.held(Handles.of(setting.character, trial.constraints))
    data = method.factorised(ids)
    return elapsed(lambda: method.deformed(data, targets))


def mesh_rows(model: FaceModel, repeats: int, others: Sequence[tuple[str, Callable[[], object]]] = ()) -> list[Row]:
    """Measure the reconstruction of vertices, a copy of the basis as its lower bound, and ``others``, in turn."""
    p = np.random.default_rng(0).normal(size=model.n_coefficients) * np.sqrt(model.subspace.variances)
    target = np.empty_like(model.basis)
    actions: dict[str, Callable[[], object]] = {
        "reconstruct": lambda: model.instance(p),
        "basis-copy": lambda: np.copyto(target, model.basis),
        **dict(others),
    }
    times: dict[str, list[float]] = {name: [] for name in actions}
    for _ in range(repeats + 1):
        for name, action in actions.items():
            times[name].append(elapsed(action))
    return [row(name, values[1:]) for name, values in times.items()]


def ratio_rows(rows: Sequence[Row]) -> list[Row]:
    """Return the ratios of medians in ``rows`` with their targets; rows that were not measured are skipped."""
    medians = {str(entry["name"]): float(str(entry["median_ms"])) for entry in rows}
    pairs = [(f"rivals/{label}/", target) for label, _ in CELLS for target in TARGETS] + [("", MESH_TARGET)]
    ratios: list[Row] = []
    for prefix, target in pairs:
        above, below = prefix + target.above, prefix + target.below
        if above in medians and below in medians:
            ratio = medians[above] / max(medians[below], 1e-9)
            met = ratio <= target.limit if target.at_most else ratio >= target.limit
            ratios.append(
                {
                    "above": above,
                    "below": below,
                    "ratio": round(ratio, 3),
                    "target": f"{'at most' if target.at_most else 'at least'} {target.limit:g}",
                    "met": met,
                }
            )
    return ratios


def print_ratios(ratios: Sequence[Row]) -> None:
    """Print the table of ``ratio_rows``."""
    print(f"{'ratio of medians':62}{'ratio':>9}  target")
    for entry in ratios:
        name = f"{entry['above']} : {str(entry['below']).rsplit('/', maxsplit=1)[-1]}"
        print(f"{name:62}{entry['ratio']:9.2f}  {entry['target']:14}{'met' if entry['met'] else 'NOT MET'}")
