"""The saved state of a document: writing its session file, and detection of unsaved changes."""

from dataclasses import replace
from pathlib import Path

from faceposer.files import paths
from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.session.document import Document, path_from, portable_character, write_document
from faceposer.session.on_disk import content_of, content_of_text


class SavedState:
    """The document as it was last saved or opened."""

    def __init__(self, document: Document, content: str | None = None) -> None:
        """Start with ``document`` as saved; ``content`` is the digest of its file, if any (``content_of``)."""
        self._document: Document | None = document
        self._content = content

    def differs_from(self, document: Document) -> bool:
        """Return True if saving ``document`` would change the content of its file."""
        return self._document is None or not document.same_input(self._document)

    def mark_unsaved(self) -> None:
        """Treat every document as changed until the next save."""
        self._document = None

    def mark_saved(self, document: Document) -> None:
        """Treat ``document`` as saved: what it shows was written elsewhere, such as to a file of a pose."""
        self._document = document

    def changed_on_disk(self, path: Path) -> bool:
        """Return True if the file ``path`` has another content than when it was opened or last saved here."""
        content = content_of(path)
        return content is not None and content != self._content

    def save(self, document: Document, path: Path, model: FaceModel, camera: Camera | None = None) -> None:
        """Write ``document`` to ``path`` and record it as saved; its paths are relative to its folder where possible.

        Args:
            document: Document to save.
            path: Session file.
            model: Face model of the document's character.
            camera: Current view, stored in the file; None for that of the document.

        Raises:
            FacePoserError: If the file cannot be written.
        """
        folder = paths.folder_of(path)
        written = replace(
            document,
            character=portable_character(document.character, folder),
            photos=tuple(replace(photo, path=path_from(photo.path, folder)) for photo in document.photos),
            camera=document.camera if camera is None else camera,
        )
        self._content = content_of_text(write_document(path, written.with_version_data(model)))
        self._document = document
