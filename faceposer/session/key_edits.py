"""Additions of pairs to a folder of keys, from files and from the frames of an animation."""

import shutil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.atomic import atomic_file
from faceposer.interchange.reading import MESHES, read_performance, read_pose
from faceposer.model.face_model import FaceModel
from faceposer.poses.applying import pose_of
from faceposer.poses.library import safe_stem
from faceposer.poses.pose_file import Pose, checked_name
from faceposer.poses.pose_file import read_pose as read_pose_file
from faceposer.progress import Progress
from faceposer.session.file_kinds import kind_of
from faceposer.session.key_folder import KeyFolder
from faceposer.session.key_proposals import Proposal, make_proposer, proposed
from faceposer.session.keys import key_displacements, load_keys
from faceposer.session.opening import load_model, open_session
from faceposer.transfer.key_coverage import HelpfulFrame, chosen_frames

Array = NDArray[np.float64]


def add_key(
    folder: KeyFolder,
    name: str,
    source: Path,
    target: Path | None = None,
    frame: int = 0,
    replaces: bool = False,
    proposal: Proposal = "auto",
) -> tuple[str, str]:
    """Add a pair to ``folder``, and return the name of its files and a remark on the source.

    Args:
        folder: The folder.
        name: Name of the pair.
        source: Pose, session, weights or mesh of the source.
        target: The same of the target; None for a proposal.
        frame: Frame of weights of the source, from 0.
        replaces: Replace a pair of this name.
        proposal: How the target's pose is proposed.

    Raises:
        FacePoserError: If a file cannot be used, or the name is taken.
    """
    model = load_model(folder.character("source"))
    pose, note = _pose_in(source, model, checked_name(name), frame)
    if target is None:
        if folder.is_mesh:
            raise FacePoserError(f"The target of '{folder.folder}' is a mesh without shapes; give --target FILE.")
        other = load_model(folder.character("target"))
        return folder.add(pose, proposed(model, other, make_proposer(model, other, proposal), pose), replaces), note
    if target.suffix.lower() in MESHES:
        if not folder.is_mesh:
            key_displacements(target, load_model(folder.character("target")).character)
        stem = folder.add(pose, None, replaces)
        copy = folder.folder / "target" / f"{stem}{target.suffix.lower()}"
        with atomic_file(copy, "key") as temporary:
            shutil.copyfile(target, temporary)
        return stem, note
    if folder.is_mesh:
        raise FacePoserError(f"The target of '{folder.folder}' is a mesh without shapes; give a mesh, not '{target}'.")
    answer, _ = _pose_in(target, load_model(folder.character("target")), pose.name, 0)
    return folder.add(pose, answer, replaces), note


def _pose_in(path: Path, model: FaceModel, name: str, frame: int) -> tuple[Pose, str]:
    """Return the pose in a pose file, a session, weights or a mesh, under a new name, and a remark."""
    if path.suffix.lower() == ".json":
        kind = kind_of(path)
        if kind == "pose":
            return read_pose_file(path).renamed(name), ""
        if not kind:
            session = open_session(str(path))
            session.wait()
            if session.model.character.name != model.character.name:
                raise FacePoserError(
                    f"The session '{path}' is of '{session.model.character.name}', not of '{model.character.name}'; "
                    "give a pose of this character."
                )
            return pose_of(model, session.coefficients, name), session.remark
    read = read_pose(path, model, frame)
    return pose_of(model, read.coefficients, name), read.note


def choose_keys(
    folder: KeyFolder, take: Path, count: int, progress: Progress | None = None
) -> list[tuple[str, HelpfulFrame]]:
    """Add the frames of ``take`` that help most as keys, with proposals for the target, and return their names.

    Raises:
        FacePoserError: If the take cannot be read, or the target is a mesh without shapes.
    """
    progress = progress or Progress()
    if folder.is_mesh:
        raise FacePoserError(
            f"The target of '{folder.folder}' is a mesh without shapes, for which nothing is proposed; add keys one "
            "by one."
        )
    model, target = load_model(folder.character("source")), load_model(folder.character("target"))
    poses = read_performance(take, model).performance.coefficients
    files = folder.entries()
    taken = {entry.name for entry in files}
    present = load_keys(folder, source=model).transfer.pairs if files else ()
    keys = np.array([pair.source for pair in present]).reshape(len(present), model.n_coefficients)
    proposer = make_proposer(model, target)
    added: list[tuple[str, HelpfulFrame]] = []
    for helpful in chosen_frames(model, keys, poses, count, folder.points, folder.regions):
        progress.check()
        name = f"{safe_stem(take.stem)[:40]} {helpful.frame}"
        while safe_stem(name) in taken:
            name += "b"
        pose = pose_of(model, poses[helpful.frame], name, ("frame",))
        added.append((folder.add(pose, proposed(model, target, proposer, pose)), helpful))
        taken.add(added[-1][0])
        progress.at("Adding keys", len(added) / count)
    return added
