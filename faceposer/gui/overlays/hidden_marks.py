"""Which constraints the user has hidden in the view; they count as before."""

from faceposer.solve.constraints.registry import Constraint


class HiddenMarks:
    """The hidden constraints of one session, by index; they keep to their constraints when others come and go."""

    def __init__(self) -> None:
        self._known: tuple[Constraint, ...] = ()
        self._hidden: frozenset[int] = frozenset()

    def indices(self, constraints: tuple[Constraint, ...]) -> frozenset[int]:
        """Return the indices of those of ``constraints`` that are hidden.

        Constraints are immutable: as long as their number stays, the index tells which is which though one was
        changed; otherwise those that are still there are the same objects.
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
