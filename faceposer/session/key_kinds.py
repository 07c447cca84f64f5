"""Kinds of key poses: which ones are emotional or verbal, and so combined with one another."""

from contextlib import suppress
from dataclasses import replace

from faceposer.errors import FacePoserError
from faceposer.poses.pose_file import read_pose, write_pose
from faceposer.session.key_folder import COMPOSED, DESCRIPTION, EXPRESSION, VISEME, KeyFolder

_KINDS = frozenset((EXPRESSION, VISEME, COMPOSED))


def set_kind(folder: KeyFolder, name: str, kind: str) -> None:
    """Make the key ``name`` an emotional key ("expression"), a verbal one ("viseme"), or neither ("").

    Poses get or lose the tags; keys that are meshes on both sides are listed in the description of the folder.

    Raises:
        FacePoserError: If there is no such key, or a file cannot be read or written.
    """
    entry = folder.existing(name)
    untagged = kind
    for path in (entry.source, entry.target):
        if path is None or path.suffix.lower() != ".json":
            continue
        pose = read_pose(path)
        tags = (*(tag for tag in pose.tags if tag not in _KINDS), *((kind,) if kind else ()))
        untagged = ""
        if tags != pose.tags:
            write_pose(path, replace(pose, tags=tags))
    expressions = tuple(other for other in folder.expressions if other != name)
    visemes = tuple(other for other in folder.visemes if other != name)
    changed = replace(
        folder,
        expressions=(*expressions, name) if untagged == EXPRESSION else expressions,
        visemes=(*visemes, name) if untagged == VISEME else visemes,
    )
    if changed != folder:
        changed.write()


def check_kinds(folder: KeyFolder) -> None:
    """Check that each key is of one kind at most, and that keys with a kind exist.

    Raises:
        FacePoserError: If they do not; the message names the file.
    """
    entries = folder.entries()
    names = {entry.name for entry in entries}
    for label, listed in (("expressions", folder.expressions), ("visemes", folder.visemes)):
        missing = next((name for name in listed if name not in names), None)
        if missing is not None:
            raise FacePoserError(
                f"'{folder.folder / DESCRIPTION}': {label} names '{missing}', but there is no such key; remove the "
                "name, or add the key."
            )
    for entry in entries:
        found = {EXPRESSION} if entry.name in folder.expressions else set[str]()
        found |= {VISEME} if entry.name in folder.visemes else set()
        for path in (entry.source, entry.target):
            if path is not None and path.suffix.lower() == ".json":
                # What cannot be read is told by the check of the keys.
                with suppress(FacePoserError):
                    found.update(read_pose(path).tags)
        if COMPOSED not in found and {EXPRESSION, VISEME} <= found:
            raise FacePoserError(
                f"The key '{entry.name}' in '{folder.folder}' is an '{EXPRESSION}' and a '{VISEME}' by its tags and "
                f"'{DESCRIPTION}'; leave one of them."
            )
