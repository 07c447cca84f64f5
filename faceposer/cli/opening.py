"""Opening of sessions by commands, with what there is to say about it."""

import sys

from faceposer.errors import printable
from faceposer.session.opening import open_session
from faceposer.session.session import Session

_LONGEST = 4000


def open_with_remark(what: str) -> Session:
    """Return ``open_session(what)``; what opening changed is printed to the standard error stream.

    Raises:
        FacePoserError: If it cannot be found or read.
    """
    session = open_session(what)
    print_remark(session)
    return session


def print_remark(session: Session) -> None:
    """Print what opening changed in ``session`` to the standard error stream, if anything."""
    if session.remark:
        print(printable(session.remark, _LONGEST), file=sys.stderr)
