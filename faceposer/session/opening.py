"""Opens what a user names: a subject, or a session with its subject."""

import difflib
from functools import lru_cache
from pathlib import Path

from faceposer.errors import FacePoserError
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.subject import available_subjects, load_subject
from faceposer.session.document import Document, read_document
from faceposer.session.session import Session
from faceposer.session.solver_worker import Worker


@lru_cache(maxsize=2)
def load_model(subject: str) -> FaceModel:
    """Return the face model of the subject with this name or path, remembering the last two.

    Raises:
        FacePoserError: If there is no such subject or its file is damaged.
    """
    return build_face_model(load_subject(subject))


def open_session(what: str, worker: Worker | None = None) -> Session:
    """Return a session for ``what``: the name or path of a subject, or the path of a session file.

    Raises:
        FacePoserError: If it cannot be found or read, or does not fit together.
    """
    path = Path(what)
    if path.suffix.lower() == ".json":
        document = read_document(path)
        subject = document.subject
        if subject.lower().endswith(".npz") and not Path(subject).is_absolute():
            # A session names its subject as seen from where the session lies.
            subject = str(path.parent / subject)
        try:
            return Session(load_model(subject), document, worker, path)
        except FacePoserError as error:
            raise FacePoserError(f"The session '{path}': {error}") from error
    if path.suffix.lower() != ".npz":
        names = [name for name, _ in available_subjects()]
        if what not in names:
            close = difflib.get_close_matches(what, names, 1)
            guess = f" Did you mean '{close[0]}'?" if close else ""
            raise FacePoserError(f"'{what}' is no subject ({', '.join(names)}) and no session file (.json).{guess}")
    return Session(load_model(what), Document(what), worker)
