"""Conflicts between constraints (Lau et al. 2009, Figure 9)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from faceposer.solve.constraints.registry import CONSTRAINTS
from faceposer.solve.problem import PoseProblem, gather_points
from faceposer.solve.reach import ReachTerm
from faceposer.solve.term import Array, PoseState

# Least share of the opposing force of an opponent.
_SHARE = 0.35
# Share of a point's residual lying beyond its reach, above which the reach is taken for the cause.
_BEYOND = 0.5


@dataclass(frozen=True)
class Conflict:
    """An unmet constraint and the cause.

    Attributes:
        index: Index of the constraint.
        opponent: Index of the constraint that opposes it most; None if the prior does.
        mobility: Mobility of a point pulled beyond its reach, from 0 (hardly moves) to 1 (see ``Reach``); None
            otherwise.
    """

    index: int
    opponent: int | None
    mobility: float | None = None


def find_conflicts(problem: PoseProblem, p: ArrayLike) -> list[Conflict]:
    """Return the constraints of ``problem`` that are unmet at its solution ``p``, shape (r,), with the causes.

    At a minimum all forces, the negative gradients of the energies, sum to zero. They are compared in the metric of the
    inverse curvature of the total energy, in which the length of a force is that of the step it would cause. The
    opponent of a constraint is the one with the largest share of the force against it.
    """
    pose = np.asarray(p, dtype=np.float64)
    residuals = problem.residuals_px(pose)
    constraints = problem.constraints
    active = [i for i, c in enumerate(constraints) if c.enabled and c.weight > 0]
    unmet = [i for i in active if residuals[i] > constraints[i].notable_px]
    if not unmet:
        return []
    anchored, slots = gather_points(problem.model, constraints)
    state, start = PoseState(anchored, pose), PoseState(anchored, problem.start)
    beyond: dict[int, float] = {}
    forces: dict[int, Array] = {}
    for i in active:
        terms = CONSTRAINTS[constraints[i].kind].terms([constraints[i]], [slots[i]], problem.model)
        if problem.limits is not None:
            limited = [
                term.within_reach(problem.model, start, problem.limits, problem.trust)
                for term in terms
                if isinstance(term, ReachTerm)
            ]
            terms = [*limited, *(term for term in terms if not isinstance(term, ReachTerm))]
            for term in limited:
                if i in unmet and term.lost > _BEYOND * residuals[i]:
                    beyond[i] = term.mobility
        forces[i] = -np.sum([term.value_and_gradient(state)[1] for term in terms], axis=0)
    metric = np.linalg.inv(problem.curvature(pose))
    conflicts = []
    for i in unmet:
        if i in beyond:
            conflicts.append(Conflict(i, None, beyond[i]))
            continue
        own = forces[i] @ metric
        strength = float(own @ forces[i])
        shares = {j: -float(own @ forces[j]) / max(strength, 1e-12) for j in active if j != i}
        opponent = max(shares, key=lambda j: shares[j], default=None)
        strong = opponent is not None and shares[opponent] > _SHARE
        conflicts.append(Conflict(i, opponent if strong else None))
    return conflicts
