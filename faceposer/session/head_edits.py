"""Edits of the head of a session: a mixin of ``Session``."""

from contextlib import AbstractContextManager
from dataclasses import replace
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from faceposer.identity.identity import Identity
from faceposer.model.face_model import FaceModel
from faceposer.session.document import Document


@lru_cache(maxsize=3)
def head_model(base: FaceModel, identity: Identity | None) -> FaceModel:
    """Return the face model of the character of ``base`` with the head ``identity``; ``base`` itself for None.

    Both have the same coefficients, so that poses stay as they are while the head changes.

    Raises:
        FacePoserError: If the character does not have the topology of the morphable model, or if the identity does not
            have its numbers of coefficients.
    """
    if identity is None:
        return base
    # Imported late to shorten the start of the window.
    from faceposer.identity.editing import edited_character

    return base.with_character(edited_character(base.character, identity))


class _Edited(Protocol):
    """Members of ``Session`` that this mixin uses."""

    base_model: FaceModel

    @property
    def document(self) -> Document: ...

    @property
    def coefficients(self) -> NDArray[np.float64]: ...

    def edit(self, label: str, merges: bool = False) -> AbstractContextManager[None]: ...

    def set_without_history(self, document: Document) -> None: ...


class HeadEdits:
    """Methods of ``Session`` that change the head of the character."""

    def set_identity(self: _Edited, identity: Identity | None, label: str, merges: bool = False) -> None:
        """Change the head, as one step; None for the character as it is.

        The pose stays and becomes the start pose: constraints are removed, since their targets are places of the
        earlier head. ``merges`` combines the step with a previous one of the same ``label``.

        Raises:
            FacePoserError: As ``head_model``.
        """
        head_model(self.base_model, identity)
        pose = self.coefficients
        document = replace(self.document, identity=identity, constraints=()).with_start(pose).posed(pose)
        with self.edit(label, merges):
            self.set_without_history(document)
