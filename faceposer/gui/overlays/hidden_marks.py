"""Constraints hidden in the view by the user; they remain in effect."""

from faceposer.solve.constraints.registry import Constraint


class HiddenMarks:
    """The hidden constraints of a session, tracked while constraints are added and removed."""

    def __init__(self) -> None:
        self._known: tuple[Constraint, ...] = ()
        self._hidden: frozenset[int] = frozenset()

    def indices(self, constraints: tuple[Constraint, ...]) -> frozenset[int]:
        """Return the indices of those of ``constraints`` that are hidden.

        While the number of constraints is unchanged, they are identified by index, as a changed constraint is a new
        object; otherwise by identity, as the remaining constraints are the same objects.
        """
        if constraints is not self._known:
            if len(constraints) != len(self._known):
                kept = {id(self._known[i]) for i in self._hidden}
                self._hidden = frozenset(i for i, c in enumerate(constraints) if id(c) in kept)
            self._known = constraints
        return self._hidden

    def toggle(self, index: int, constraints: tuple[Constraint, ...]) -> None:
        """Hide constraint ``index`` of ``constraints``, or show it again."""
        self._hidden = self.indices(constraints) ^ {index}
