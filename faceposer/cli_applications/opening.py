"""Opening of sessions by commands, with what there is to say about it."""

import sys

from faceposer.session.opening import open_session
from faceposer.session.session import Session


def open_with_remark(what: str) -> Session:
    """Return ``open_session(what)``; what opening changed is printed to the standard error stream.

    Raises:
        FacePoserError: If it cannot be found or read.
    """
    session = open_session(what)
    if session.remark:
        print(session.remark, file=sys.stderr)
    return session
