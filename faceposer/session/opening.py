"""Opening characters and sessions by name or path."""

import difflib
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from faceposer.errors import FacePoserError, MissingCharacterError, NoSessionError
from faceposer.files.paths import expand_user, folder_of
from faceposer.model.character_file import available_characters, load_character
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.photo.photo import absolute_path
from faceposer.session.document import Document, absolute_character, read_document
from faceposer.session.file_kinds import kind_of
from faceposer.session.head_edits import head_model
from faceposer.session.on_disk import content_of
from faceposer.session.rebinding import rebind
from faceposer.session.session import Session
from faceposer.session.solver_worker import Worker


def load_model(character: str) -> FaceModel:
    """Return the face model of the character with this name or path; the last two are cached until they change.

    Raises:
        FacePoserError: If there is no such character or if its file is damaged.
    """
    stamp: tuple[int, ...] = ()
    if character.lower().endswith(".npz"):
        # Detects a file that was rewritten.
        with suppress(OSError, ValueError):
            status = expand_user(character).stat()
            stamp = (status.st_mtime_ns, status.st_size, status.st_ino)
    return _load_model(character, stamp)


@lru_cache(maxsize=2)
def _load_model(character: str, _stamp: tuple[int, ...]) -> FaceModel:
    return build_face_model(load_character(character))


def open_session(what: str, worker: Worker | None = None, character: str = "") -> Session:
    """Return a session for ``what``: the name or path of a character, or the path of a session file.

    Args:
        what: Name or path.
        worker: Solver; None to solve in the caller's thread.
        character: Name or path of another character for a session file, in place of the one that the file names.

    Raises:
        MissingCharacterError: If the character of a session file is not found.
        FacePoserError: If it cannot be found or read, or if the session does not fit its character.
    """
    path = Path(what)
    if path.suffix.lower() == ".json":
        content = content_of(path)
        try:
            document = read_document(path)
        except FacePoserError as error:
            if kind_of(path):
                raise NoSessionError(str(error), what) from error
            raise
        return session_for(replace(document, character=character) if character else document, path, worker, content)
    if path.suffix.lower() != ".npz":
        names = [name for name, _ in available_characters()]
        if what not in names:
            close = difflib.get_close_matches(what, names, 1)
            guess = f" Did you mean '{close[0]}'?" if close else ""
            raise NoSessionError(
                f"'{what}' is neither a character ({', '.join(names)}) nor a session file (.json).{guess}", what
            )
    return Session(load_model(what), Document(absolute_character(what, Path())), worker)


def session_for(
    document: Document, path: Path | None, worker: Worker | None = None, content: str | None = None
) -> Session:
    """Return a session for ``document`` with its character.

    Args:
        document: Document to edit.
        path: Its session file, if any; relative paths in the document start at the folder of this file.
        worker: Solver; None to solve in the caller's thread.
        content: Digest of the content of that file when the document was read (``content_of``).

    Raises:
        FacePoserError: If the character cannot be found or read, or if the document does not fit it.
    """
    folder = Path() if path is None else folder_of(path)
    character = absolute_character(document.character, folder)
    photos = tuple(replace(photo, path=absolute_path(photo.path, folder)) for photo in document.photos)
    try:
        model = load_model(character)
        rebinding = rebind(replace(document, character=character, photos=photos), head_model(model, document.identity))
        return Session(model, rebinding.document, worker, path, rebinding.remark, content)
    except MissingCharacterError as error:
        if path is None:
            raise
        if not character.lower().endswith(".npz"):
            names = ", ".join(f"'{name}'" for name, _ in available_characters())
            raise MissingCharacterError(
                f"The session '{path}' names the character '{character}', which is neither one that is installed "
                f"({names}) nor the path of a character file (.npz).",
                character,
            ) from error
        raise MissingCharacterError(
            f"The session '{path}' needs the character '{Path(character).stem}', which was removed or moved: there is "
            f"no '{character}'.",
            character,
        ) from error
    except FacePoserError as error:
        if path is None:
            raise
        raise FacePoserError(f"The session '{path}': {error}") from error
