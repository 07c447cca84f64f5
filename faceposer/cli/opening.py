"""Opening of sessions by commands, with remarks on standard error."""

import sys

from faceposer.errors import printable
from faceposer.session.opening import open_session
from faceposer.session.session import Session

_LONGEST = 4000


def open_with_remark(what: str) -> Session:
    """Return ``open_session(what)``, printing the remark about changes made on opening to standard error.

    Raises:
        FacePoserError: If ``what`` cannot be found or read.
    """
    session = open_session(what)
    print_remark(session)
    return session


def print_remark(session: Session) -> None:
    """Print the remark about changes made on opening ``session`` to standard error, if there is one."""
    if session.remark:
        print(printable(session.remark, _LONGEST), file=sys.stderr)
