"""Edits of the settings of a document: a mixin of ``Session``."""

from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Protocol

from faceposer.session.document import Document
from faceposer.solve.constraints.sketch import SketchMethod
from faceposer.solve.priors import Prior


class _Edited(Protocol):
    """Members of ``Session`` that this mixin uses."""

    @property
    def document(self) -> Document: ...

    @property
    def editing(self) -> bool: ...

    def edit(self, label: str, merges: bool = False) -> AbstractContextManager[None]: ...

    def replace(self, document: Document) -> None: ...

    def set_without_history(self, document: Document) -> None: ...


class SettingEdits:
    """Methods of ``Session`` that change how constraints are solved and the face is shown."""

    def set_prior_weight(self: _Edited, weight: float) -> None:
        """Change the weight of the prior, inside the open edit or as one step."""
        _change(self, replace(self.document, prior_weight=weight), "Change the prior weight")

    def set_spread(self: _Edited, spread: float) -> None:
        """Change the spread, 0 to 1, of the constraints' influence, inside the open edit or as one step."""
        _change(self, replace(self.document, spread=spread), "Change the spread")

    def set_prior(self: _Edited, prior: Prior) -> None:
        """Change the kind of the prior, as one step."""
        with self.edit("Change the prior"):
            self.replace(replace(self.document, prior=prior))

    def set_sketch_method(self: _Edited, method: SketchMethod) -> None:
        """Change how sketches determine the face, as one step."""
        if method != self.document.sketch_method:
            with self.edit("Change the method of sketches"):
                self.replace(replace(self.document, sketch_method=method))

    def set_contact(self: _Edited, contact: bool) -> None:
        """Turn the contact step on or off, as one step; the pose remains unchanged."""
        if contact != self.document.contact:
            with self.edit("Turn contact on" if contact else "Turn contact off"):
                self.set_without_history(replace(self.document, contact=contact))


def _change(session: _Edited, document: Document, label: str) -> None:
    """Replace the document inside the open edit, such as the drag of a slider, or else as one step."""
    if session.editing:
        session.replace(document)
        return
    with session.edit(label):
        session.replace(document)
