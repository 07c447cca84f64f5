"""Edits of the head of a session: a mixin of ``Session``."""

from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.identity.identity import Identity
from faceposer.model.face_model import FaceModel
from faceposer.session.document import Document


@dataclass(frozen=True, eq=False)
class Preview:
    """A head that is shown, but not set.

    Attributes:
        identity: The head.
        vertices: Its vertices in the present pose, shape (N, 3).
    """

    identity: Identity
    vertices: NDArray[np.float32]


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
    preview: Preview | None
    head_held: str
    revision: int

    @property
    def document(self) -> Document: ...

    @property
    def model(self) -> FaceModel: ...

    @property
    def coefficients(self) -> NDArray[np.float64]: ...

    def edit(self, label: str, merges: bool = False) -> AbstractContextManager[None]: ...

    def set_without_history(self, document: Document) -> None: ...


class HeadEdits:
    """Methods of ``Session`` that change the head of the character.

    Attributes:
        preview: The head shown during a gesture, before it is set, or None.
        head_held: Why the head cannot be changed at present, one sentence, or "".
    """

    preview: Preview | None = None
    head_held: str = ""

    def preview_identity(self: _Edited, identity: Identity | None) -> None:
        """Show the head ``identity`` in the present pose, approximately, until it is set; None ends the preview.

        Raises:
            FacePoserError: As ``head_model``, or if the head is held.
        """
        if identity is None and self.preview is None:
            return
        if identity is not None and self.head_held:
            raise FacePoserError(self.head_held)
        self.preview = None
        if identity is not None:
            from faceposer.identity.editing import head_editor

            editor = head_editor(self.base_model.character)
            shown = editor.preview(self.model, self.coefficients, identity, self.document.contact)
            self.preview = Preview(identity, shown)
        self.revision += 1

    def set_identity(self: _Edited, identity: Identity | None, label: str) -> None:
        """Change the head, as one step; None for the character as it is.

        The pose stays and becomes the start pose: constraints are removed, since their targets are places of the
        earlier head.

        Raises:
            FacePoserError: As ``head_model``, or if the head is held.
        """
        if self.head_held:
            raise FacePoserError(self.head_held)
        head_model(self.base_model, identity)
        self.preview = None
        pose = self.coefficients
        document = replace(self.document, identity=identity, constraints=()).with_start(pose).posed(pose)
        with self.edit(label):
            self.set_without_history(document)
