"""Opens what a user names: a character, or a session with its character."""

import difflib
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from faceposer.errors import FacePoserError
from faceposer.model.character_file import available_characters, load_character
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.photo.photo import whole_path
from faceposer.session.document import Document, read_document, whole_character
from faceposer.session.rebinding import rebound
from faceposer.session.session import Session
from faceposer.session.solver_worker import Worker


def load_model(character: str) -> FaceModel:
    """Return the face model of the character with this name or path, remembering the last two as long as they stay.

    Raises:
        FacePoserError: If there is no such character or its file is damaged.
    """
    stamp: tuple[int, ...] = ()
    if character.lower().endswith(".npz"):
        # A file may have been written anew since.
        with suppress(OSError):
            status = Path(character).expanduser().stat()
            stamp = (status.st_mtime_ns, status.st_size, status.st_ino)
    return _load_model(character, stamp)


@lru_cache(maxsize=2)
def _load_model(character: str, _stamp: tuple[int, ...]) -> FaceModel:
    return build_face_model(load_character(character))


def open_session(what: str, worker: Worker | None = None) -> Session:
    """Return a session for ``what``: the name or path of a character, or the path of a session file.

    Raises:
        FacePoserError: If it cannot be found or read, or does not fit together.
    """
    path = Path(what)
    if path.suffix.lower() == ".json":
        return session_of(read_document(path), path, worker)
    if path.suffix.lower() != ".npz":
        names = [name for name, _ in available_characters()]
        if what not in names:
            close = difflib.get_close_matches(what, names, 1)
            guess = f" Did you mean '{close[0]}'?" if close else ""
            raise FacePoserError(f"'{what}' is no character ({', '.join(names)}) and no session file (.json).{guess}")
    return Session(load_model(what), Document(whole_character(what, Path())), worker)


def session_of(document: Document, path: Path | None, worker: Worker | None = None) -> Session:
    """Return a session for ``document`` with the character that it names.

    Args:
        document: What to edit.
        path: The session file that it belongs to, if any; it names its character as seen from where that lies.
        worker: Solves.

    Raises:
        FacePoserError: If the character cannot be found or read, or does not fit.
    """
    folder = Path() if path is None else path.parent
    character = whole_character(document.character, folder)
    photos = tuple(replace(photo, path=whole_path(photo.path, folder)) for photo in document.photos)
    try:
        model = load_model(character)
        rebinding = rebound(replace(document, character=character, photos=photos), model)
        return Session(model, rebinding.document, worker, path, rebinding.remark)
    except FacePoserError as error:
        if path is None:
            raise
        raise FacePoserError(f"The session '{path}': {error}") from error
