"""Atomic writes of files and folders: the old content remains until the new one is complete."""

import errno
import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from faceposer.errors import FacePoserError
from faceposer.files import paths as path_checks
from faceposer.files.key_places import check_not_key
from faceposer.files.temporary import remove_left, temporary_path


@contextmanager
def atomic_file(path: Path, kind: str, durable: bool = True) -> Iterator[Path]:
    """Yield a temporary path next to ``path`` that replaces it at the end of the block, unless the block raises.

    If ``path`` is a link, the file that it leads to is replaced, and the link remains. Temporary files left in the
    folder by programs that were killed are removed.

    Args:
        path: The file; its folder must exist.
        kind: Noun for messages, such as "session".
        durable: True to wait until the content is on the disk (fsync), so that it survives a power failure.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    file = _replaced(path, kind)
    temporary = temporary_path(file)
    try:
        remove_left(file.parent)
        yield temporary
        if durable:
            _sync(temporary, os.O_RDWR)
        temporary.replace(file)
        if durable:
            _sync_folder(file.parent)
    except OSError as error:
        raise FacePoserError(_cannot(kind, path, error)) from error
    finally:
        # Cleaning up must not hide the first error.
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


@contextmanager
def atomic_files(paths: Sequence[Path], kind: str, durable: bool = True) -> Iterator[list[Path]]:
    """Yield temporary paths next to ``paths`` that replace all of them at the end of the block, or none.

    As in ``atomic_file``, links remain.

    Args:
        paths: The files, at least one, in the order of replacement; their folders must exist. Messages name the last.
        kind: Noun for messages, such as "mesh".
        durable: See ``atomic_file``.

    Raises:
        FacePoserError: If a file cannot be written; the old files are then restored.
    """
    files = [_replaced(path, kind if path == paths[-1] else "file") for path in paths]
    whole = [path_checks.resolved(file) for file in files]
    if len(set(whole)) < len(whole):
        names = " and ".join(f"'{path}'" for path, file in zip(paths, whole, strict=True) if whole.count(file) > 1)
        raise FacePoserError(f"The {kind} '{paths[-1]}' cannot be written: {names} are links to one file; remove one.")
    temporaries = [temporary_path(file) for file in files]
    olds = [file.with_name(f"{file.name}.old") for file in files]
    backups = [temporary_path(old) for old in olds]
    try:
        for folder in {file.parent for file in files}:
            remove_left(folder)
        yield temporaries
        for temporary in temporaries if durable else ():
            _sync(temporary, os.O_RDWR)
        _replace_all(files, temporaries, backups)
        for folder in {file.parent for file in files} if durable else ():
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

    If ``path`` is a link, the empty folder that it leads to is replaced, and the link remains.

    Raises:
        FacePoserError: If ``path`` is not an empty folder with a name, or if it cannot be written.
    """
    place = _new_folder(path, kind)
    temporary = temporary_path(place)
    try:
        remove_left(place.parent)
        temporary.mkdir()
        yield temporary
        if path_checks.exists(place):
            place.rmdir()
        temporary.replace(place)
        _sync_folder(place.parent)
    except OSError as error:
        raise FacePoserError(_cannot(kind, path, error)) from error
    except FacePoserError as error:
        # Writers of the files in it name the temporary folder.
        said = str(error).replace(str(temporary), str(path))
        if said == str(error):
            raise
        raise FacePoserError(said) from error
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
    if path is None or not path_checks.exists(path):
        return
    for source in inputs:
        if source is not None and path_checks.same_file(path, source):
            raise FacePoserError(f"'{path}' is also an input; give the output another name.")


def check_distinct(path: Path, other: Path) -> None:
    """Check that the outputs ``path`` and ``other`` are two files, whatever links and ".." lead to them.

    Raises:
        FacePoserError: If they are one file.
    """
    if path_checks.resolved(path) == path_checks.resolved(other) or path_checks.same_file(path, other):
        raise FacePoserError(f"'{path}' is also the output; give the report another name.")


def check_output(path: Path, *suffixes: str) -> None:
    """Check that an output can be written and has one of the ``suffixes``, before any work is done for it.

    Raises:
        FacePoserError: If the file could not be written.
    """
    if path.suffix.lower() not in suffixes:
        quoted = [f"'{suffix}'" for suffix in suffixes]
        choices = " or ".join(filter(None, (", ".join(quoted[:-1]), quoted[-1])))
        raise FacePoserError(f"The output '{path}' must end in {choices}.")
    if path_checks.is_dir(path):
        raise FacePoserError(f"The output '{path}' is a folder; give the name of a file.")
    check_folder_of(_replaced(path, "output"))


def check_folder_of(path: Path) -> None:
    """Check that the output ``path`` could be written to its folder, before any work is done for it.

    Raises:
        FacePoserError: If it could not, or is among key poses.
    """
    check_not_key(path)
    folder = path_checks.absolute(path).parent
    if reason := path_checks.problem(path):
        raise FacePoserError(f"The output '{path}' cannot be written: {reason}.")
    if not path_checks.is_dir(folder):
        raise FacePoserError(f"The folder '{folder}' of the output does not exist; create it first.")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise FacePoserError(f"The folder '{folder}' of the output is not writable; choose another.")


def check_sequence_folder(path: Path) -> None:
    """Check that ``atomic_folder`` could write the folder ``path``, before any work is done for it.

    Raises:
        FacePoserError: If it could not.
    """
    if reason := path_checks.problem(path):
        raise FacePoserError(f"The output '{path}' cannot be written: {reason}.")
    check_folder_of(_new_folder(path, "output"))


def check_new_folder(path: Path) -> None:
    """Check that the folder ``path`` could be written, or created with its parents, before any work is done for it.

    Raises:
        FacePoserError: If it could not.
    """
    if reason := path_checks.problem(path):
        raise FacePoserError(f"The folder '{path}' cannot be written: {reason}.")
    folder = path_checks.absolute(_followed(path, "folder"))
    while not path_checks.exists(folder) and folder != folder.parent:
        folder = folder.parent
    if not path_checks.is_dir(folder):
        raise FacePoserError(f"The folder '{path}' cannot be created, since '{folder}' is a file.")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise FacePoserError(f"The folder '{folder}' is not writable; choose another.")


def _new_folder(path: Path, kind: str) -> Path:
    """Return the new or empty folder that a write to ``path`` replaces, ``path`` or what it leads to.

    Raises:
        FacePoserError: If it has no name of its own, as "." has none, or is not an empty folder.
    """
    if path.name in ("", ".."):
        raise FacePoserError(f"'{path}' is not the name of a new folder; give a name, such as '{path / 'frames'}'.")
    place = _followed(path, kind)
    try:
        is_free = not path_checks.exists(place) or (path_checks.is_dir(place) and not any(place.iterdir()))
    except OSError as error:
        raise FacePoserError(_cannot(kind, path, error)) from error
    if not is_free:
        raise FacePoserError(f"'{path}' exists and is not an empty folder; give the name of a new one.")
    return place


def _replaced(path: Path, kind: str) -> Path:
    """Return the file that a write to ``path`` replaces: ``path``, or what it leads to if it is a link.

    Raises:
        FacePoserError: If that is a folder, a device or another special file, or a link leads nowhere.
    """
    file = _followed(path, kind)
    if path_checks.exists(file) and not path_checks.is_file(file):
        what = "a folder" if path_checks.is_dir(file) else "a device or another special file"
        verb = "is" if file == path else "leads to"
        raise FacePoserError(f"The {kind} '{path}' cannot be written: it {verb} {what}; enter another name.")
    return file


def _followed(path: Path, kind: str) -> Path:
    """Return ``path``, or what it leads to if it is a link.

    Raises:
        FacePoserError: If the link leads nowhere.
    """
    if not path_checks.is_link(path):
        return path
    try:
        return path.resolve(strict=True)
    except FileNotFoundError:
        reason = "it is a link to something that does not exist; remove the link, or enter another name"
    except (OSError, RuntimeError) as error:
        # Links in circles are a RuntimeError until Python 3.12.
        system = error.strerror if isinstance(error, OSError) and error.errno != errno.ELOOP else None
        reason = f"it is a link that cannot be followed, {system or 'since it leads in a circle'}; enter another name"
    raise FacePoserError(f"The {kind} '{path}' cannot be written: {reason}.")


def _cannot(kind: str, path: Path, error: OSError) -> str:
    return f"The {kind} '{path}' cannot be written: {error.strerror or error}."


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
