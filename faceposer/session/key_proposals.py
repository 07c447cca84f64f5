"""Folders of key poses from pose libraries, with proposals for keys that the target lacks."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.atomic import atomic_folder
from faceposer.files.paths import expand_user
from faceposer.geometry.mesh_io import POSED_MESH_SUFFIXES
from faceposer.model.face_model import FaceModel
from faceposer.poses.applying import applied, pose_of, weights_on
from faceposer.poses.library import Entry, PoseLibrary, safe_stem, starter_poses
from faceposer.poses.pose_file import Pose
from faceposer.progress import Progress
from faceposer.session.document import path_from, portable_character
from faceposer.session.key_entries import count_with_neutral
from faceposer.session.key_files import neutral_of
from faceposer.session.key_folder import COMPOSED, KeyFolder
from faceposer.session.opening import load_model
from faceposer.transfer.examples import MOST_KEYS
from faceposer.transfer.key_parameters import Regions
from faceposer.transfer.transfer import Transfer, make_transfer
from faceposer.transfer.weights import arkit_rows

Array = NDArray[np.float64]
#: How missing keys of the target are proposed; "auto" is weights between rigs that mean the same, else distances.
Proposal = Literal["auto", "distances", "weights"]
#: Tag of a pose that was proposed and not yet edited.
PROPOSED = "proposed"
# Built-in poses beyond the six emotional and thirteen verbal keys of the paper.
_BEYOND_PAPER = frozenset({"Disgust", "Contempt"})


def create_keys(
    folder: Path,
    source: str,
    target: str,
    poses: Path | None = None,
    every: bool = False,
    proposal: Proposal = "auto",
    regions: Regions = "whole",
    progress: Progress | None = None,
) -> KeyFolder:
    """Create a folder of keys from the pose libraries of two characters.

    The target's key is its own pose of the same name, or else a proposal.

    Args:
        folder: New or empty folder.
        source: Name or file of the character that plays.
        target: Name or file of the character that follows, or its neutral mesh, which gets no proposals.
        poses: Folder of the source's poses; None for the built-in ones.
        every: Take all built-in poses, beyond the five emotions and thirteen visemes of the paper.
        proposal: How missing keys are proposed.
        regions: Regions that are cloned separately.
        progress: Receives the progress.

    Raises:
        FacePoserError: If the target's mesh cannot be used, there are no poses for the source, or the folder cannot be
            written.
    """
    progress = progress or Progress()
    is_mesh = Path(target).suffix.lower() in POSED_MESH_SUFFIXES
    if is_mesh:
        neutral_of(expand_user(target))
    face = load_model(source)
    entries = PoseLibrary(poses).entries() if poses is not None else starter_poses()
    known = [entry.pose for entry in entries if entry.pose is not None]
    usable = [entry for entry in entries if entry.pose and weights_on(entry.pose, face.character) is not None]
    if poses is None and not every:
        usable = [entry for entry in usable if entry.title not in _BEYOND_PAPER]
    if not usable:
        where = f"in '{poses}'" if poses is not None else "built in"
        raise FacePoserError(f"There are no poses for the character '{source}' {where}; save poses, and use --poses.")
    _check_names(usable)
    chosen = [entry.pose for entry in usable if entry.pose is not None]
    other = None if is_mesh else load_model(target)
    with atomic_folder(folder) as temporary:
        keys = KeyFolder(temporary, _portable_target(source, folder), _portable_target(target, folder), regions=regions)
        keys.write()
        proposer = None
        for i, pose in enumerate(chosen):
            progress.check()
            answer = None
            if other is not None:
                answer = _own(other, pose.name, known)
                if answer is None:
                    proposer = proposer or make_proposer(face, other, proposal)
                    answer = proposed(face, other, proposer, pose)
            keys.add(_on(face, pose), answer, durable=False)
            progress.at("Proposing keys", (i + 1) / len(chosen))
    return replace(keys, folder=folder)


def _check_names(entries: Sequence[Entry]) -> None:
    """Check that the poses of ``entries`` become keys of different names, and not too many.

    Raises:
        FacePoserError: If they do not.
    """
    files: dict[str, Path] = {}
    for entry in entries:
        name = safe_stem(entry.title)
        other = files.setdefault(name, entry.path)
        if other != entry.path:
            raise FacePoserError(
                f"The poses '{other}' and '{entry.path}' would both become the key '{name}'; rename or remove one of "
                "them."
            )
    count = count_with_neutral(files)
    if count > MOST_KEYS:
        raise FacePoserError(
            f"'{entries[0].path.parent}' has {len(files)} poses, which make {count} keys with the neutral face, more "
            f"than the maximum of {MOST_KEYS}; use fewer."
        )


def make_proposer(source: FaceModel, target: FaceModel, proposal: Proposal = "auto") -> Transfer:
    """Return the transfer that proposes keys of ``target``.

    Raises:
        FacePoserError: If the characters lack the data that it needs.
    """
    if proposal == "auto":
        shared = arkit_rows(source.character).keys() & arkit_rows(target.character).keys()
        proposal = "weights" if 2 * len(shared) > len(target.character.shape_names) else "distances"
    return make_transfer(source, target, proposal)


def proposed(source: FaceModel, target: FaceModel, proposer: Transfer, pose: Pose) -> Pose:
    """Return the proposal for ``pose`` of the source on the target."""
    coefficients = proposer.pose(applied(source, source.neutral(), pose))
    tags = tuple(dict.fromkeys((*(tag for tag in pose.tags if tag != COMPOSED), PROPOSED)))
    note = "Proposed by a transfer; edit it, and remove this tag and note."
    return replace(pose_of(target, coefficients, pose.name, tags), note=note)


def _on(model: FaceModel, pose: Pose) -> Pose:
    """Return ``pose`` in the shapes of ``model``."""
    return replace(pose_of(model, applied(model, model.neutral(), pose), pose.name, pose.tags), note=pose.note)


def _own(target: FaceModel, name: str, poses: Sequence[Pose]) -> Pose | None:
    """Return the pose with this name made on the character ``target``, if there is one."""
    own = [pose for pose in poses if pose.name == name and pose.character == target.character.name]
    return _on(target, own[0]) if own and weights_on(own[0], target.character) is not None else None


def _portable_target(target: str, folder: Path) -> str:
    """Return the reference to a character or a mesh in the description of the keys in ``folder``."""
    if Path(target).suffix.lower() not in POSED_MESH_SUFFIXES:
        return portable_character(target, folder)
    return path_from(target, folder)
