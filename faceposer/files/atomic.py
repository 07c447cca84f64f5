"""Atomic writes of files and folders: the old content remains until the new one is complete."""

import os
import re
import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from faceposer.errors import FacePoserError
from faceposer.files import paths

_TEMPORARY = re.compile(r"\..+\.(\d+)\.tmp")
# Maximum length of a file name on common systems, in bytes; temporary files have longer names than their files.
_LONGEST_NAME = 255


@contextmanager
def atomic_file(path: Path, kind: str, durable: bool = True) -> Iterator[Path]:
    """Yield a temporary path next to ``path`` that replaces it at the end of the block, unless the block raises.

    Temporary files of the same path left by crashed programs are removed.

    Args:
        path: The file; its folder must exist.
        kind: Noun for messages, such as "session".
        durable: True to wait until the content is on the disk (fsync), so that it survives a power failure.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    temporary = _temporary(path)
    try:
        _remove_stale(path)
        yield temporary
        if durable:
            _sync(temporary, os.O_RDWR)
        temporary.replace(path)
        if durable:
            _sync_folder(path.parent)
    except OSError as error:
        raise FacePoserError(_cannot(kind, path, error)) from error
    finally:
        # Cleaning up must not hide the first error.
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


@contextmanager
def atomic_files(paths: Sequence[Path], kind: str) -> Iterator[list[Path]]:
    """Yield temporary paths next to ``paths`` that replace all of them at the end of the block, or none.

    Args:
        paths: The files, at least one, in the order of replacement; their folders must exist. Messages name the last.
        kind: Noun for messages, such as "mesh".

    Raises:
        FacePoserError: If a file cannot be written; the old files are then restored.
    """
    temporaries = [_temporary(path) for path in paths]
    olds = [path.with_name(f"{path.name}.old") for path in paths]
    backups = [_temporary(old) for old in olds]
    try:
        for path in (*paths, *olds):
            _remove_stale(path)
        yield temporaries
        for temporary in temporaries:
            _sync(temporary, os.O_RDWR)
        _replace_all(paths, temporaries, backups)
        for folder in {path.parent for path in paths}:
            _sync_folder(folder)
    except OSError as error:
        raise FacePoserError(_cannot(kind, paths[-1], error)) from error
    finally:
        # Cleaning up must not hide the first error.
        for left in (*temporaries, *backups):
            with suppress(OSError):
                left.unlink(missing_ok=True)


def _replace_all(paths: Sequence[Path], temporaries: Sequence[Path], backups: Sequence[Path]) -> None:
    """Move ``temporaries`` to ``paths``; after a failure, the old files are restored from ``backups``."""
    replaced: list[tuple[Path, Path]] = []
    try:
        for path, temporary, backup in zip(paths, temporaries, backups, strict=True):
            if os.path.lexists(path):
                _keep(path, backup)
            temporary.replace(path)
            replaced.append((path, backup))
    except BaseException:
        for path, backup in reversed(replaced):
            with suppress(OSError):
                if os.path.lexists(backup):
                    backup.replace(path)
                else:
                    path.unlink()
        raise


def _keep(path: Path, backup: Path) -> None:
    """Create a hard link ``backup`` to the file ``path``, or a copy if the file system does not support links."""
    try:
        os.link(path, backup, follow_symlinks=False)
    except (OSError, NotImplementedError):
        shutil.copy2(path, backup, follow_symlinks=False)


@contextmanager
def atomic_folder(path: Path, kind: str = "folder") -> Iterator[Path]:
    """Yield a temporary folder next to ``path``, which must be new or empty, that becomes ``path`` at the end.

    Raises:
        FacePoserError: If ``path`` is not an empty folder, or if it cannot be written.
    """
    temporary = _temporary(path)
    try:
        if path.exists() and (not path.is_dir() or any(path.iterdir())):
            raise FacePoserError(f"'{path}' exists and is not an empty folder; give the name of a new one.")
        _remove_stale(path)
        temporary.mkdir()
        yield temporary
        if path.exists():
            path.rmdir()
        temporary.replace(path)
        _sync_folder(path.parent)
    except OSError as error:
        raise FacePoserError(_cannot(kind, path, error)) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def write_text(path: Path, text: str, kind: str, durable: bool = True) -> None:
    """Write ``text`` to ``path`` in UTF-8, atomically; for ``kind`` and ``durable`` see ``atomic_file``.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    with atomic_file(path, kind, durable) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def check_not_input(path: Path | None, *inputs: Path | str | None) -> None:
    """Check that an output ``path`` is not one of the ``inputs``, which it would overwrite; None is ignored.

    Raises:
        FacePoserError: If it is an input.
    """
    if path is None or not paths.exists(path):
        return
    for source in inputs:
        if source is not None and paths.same_file(path, source):
            raise FacePoserError(f"'{path}' is also an input; give the output another name.")


def check_output(path: Path, *suffixes: str) -> None:
    """Check that an output can be written and has one of the ``suffixes``, before any work is done for it.

    Raises:
        FacePoserError: If the file could not be written.
    """
    if path.suffix.lower() not in suffixes:
        quoted = [f"'{suffix}'" for suffix in suffixes]
        choices = " or ".join(filter(None, (", ".join(quoted[:-1]), quoted[-1])))
        raise FacePoserError(f"The output '{path}' must end in {choices}.")
    if paths.is_dir(path):
        raise FacePoserError(f"The output '{path}' is a folder; give the name of a file.")
    if not paths.is_dir(path.parent):
        raise FacePoserError(f"The folder '{path.parent}' of the output does not exist; create it first.")
    if not os.access(path.parent, os.W_OK):
        raise FacePoserError(f"The folder '{path.parent}' of the output is not writable; choose another.")


def _cannot(kind: str, path: Path, error: OSError) -> str:
    return f"The {kind} '{path}' cannot be written: {error.strerror or error}."


def _temporary(path: Path) -> Path:
    """Return the path of this process's temporary file or folder for ``path``."""
    tail = f".{os.getpid()}.tmp"
    room = _LONGEST_NAME - len(tail) - 1
    name = path.name.encode("utf-8", "surrogateescape")
    # A name too long for its temporary file is cut; one too long for the system fails at the replacement.
    short = name[:room].decode("utf-8", "ignore") if len(name) > room else path.name
    return path.with_name(f".{short}{tail}")


def _remove_stale(path: Path) -> None:
    """Remove temporary files and folders of ``path`` whose process has ended."""
    if _TEMPORARY.fullmatch(path.parent.name):
        # Inside a temporary folder, a sequence of thousands of files would scan the folder for each of them.
        return
    prefix = f".{path.name}."
    with suppress(OSError), os.scandir(path.parent) as entries:
        for entry in entries:
            match = _TEMPORARY.fullmatch(entry.name) if entry.name.startswith(prefix) else None
            if match is None or entry.name != f"{prefix}{match[1]}.tmp" or _is_running(int(match[1])):
                continue
            if entry.is_dir(follow_symlinks=False):
                shutil.rmtree(entry.path, ignore_errors=True)
            else:
                with suppress(OSError):
                    Path(entry.path).unlink()


def _is_running(pid: int) -> bool:
    """Return True if a process ``pid`` may exist; always on Windows, where the check could end the process."""
    if sys.platform == "win32" or not 0 < pid < 2**31:
        return True
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


def _sync(path: Path, flags: int) -> None:
    descriptor = os.open(path, flags)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _sync_folder(folder: Path) -> None:
    """Flush the entries of a folder to the disk, if supported."""
    # Windows cannot open folders, and some network drives cannot sync them.
    with suppress(OSError):
        _sync(folder, os.O_RDONLY)
