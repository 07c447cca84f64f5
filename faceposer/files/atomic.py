"""Files that appear whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from faceposer.errors import FacePoserError


@contextmanager
def replacing(path: Path, kind: str) -> Iterator[Path]:
    """Give the path of a temporary file beside ``path`` that takes its place at the end, unless something is raised.

    Raises:
        FacePoserError: If the file cannot be written; ``kind`` says what it is.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        raise FacePoserError(f"The {kind} '{path}' cannot be written: {error.strerror}.") from error
    finally:
        temporary.unlink(missing_ok=True)


def check_apart(path: Path | None, *inputs: Path | str | None) -> None:
    """Refuse an output ``path`` that is one of the ``inputs``, which would be lost; what is None does not count.

    Raises:
        FacePoserError: If it is.
    """
    if path is None or not path.exists():
        return
    for source in inputs:
        if source is not None and Path(source).exists() and path.samefile(source):
            raise FacePoserError(f"'{path}' is what is read; give the output another name.")


def check_output(path: Path, *suffixes: str) -> None:
    """Refuse an output that could not be written, or ends in none of ``suffixes``, before any work is done for it.

    Raises:
        FacePoserError: If the file could not be written.
    """
    if path.suffix.lower() not in suffixes:
        quoted = [f"'{suffix}'" for suffix in suffixes]
        endings = " or ".join(filter(None, (", ".join(quoted[:-1]), quoted[-1])))
        raise FacePoserError(f"The output '{path}' must end in {endings}.")
    if path.is_dir():
        raise FacePoserError(f"The output '{path}' is a folder; give the name of a file.")
    if not path.parent.is_dir():
        raise FacePoserError(f"The folder '{path.parent}' of the output does not exist; make it first.")
    if not os.access(path.parent, os.W_OK):
        raise FacePoserError(f"The folder '{path.parent}' of the output cannot be written to; choose another.")
