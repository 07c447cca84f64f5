"""Additions of pairs to a folder of keys, from files and from the frames of an animation."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.files.atomic import atomic_file
from faceposer.geometry.mesh_io import POSED_MESH_SUFFIXES
from faceposer.model.face_model import FaceModel
from faceposer.poses.applying import applied, pose_of
from faceposer.poses.library import safe_stem
from faceposer.poses.pose_file import Pose, write_pose
from faceposer.poses.pose_file import read_pose as read_pose_file
from faceposer.progress import Progress
from faceposer.session.file_kinds import kind_of
from faceposer.session.key_folder import SIDES, KeyFolder, KeyTakenError, Side, checked_key_name
from faceposer.session.key_proposals import PROPOSED, Proposal, make_proposer, proposed
from faceposer.session.keys import key_displacements, key_pose, load_keys
from faceposer.session.opening import load_model, open_session
from faceposer.transfer.examples import same_expression
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
    checked = checked_key_name(name)
    _check_free(folder, checked, replaces)
    pose, note = _pose_in(source, model, checked, frame)
    _check_new(folder, model, pose)
    if target is None:
        if folder.is_mesh:
            raise FacePoserError(f"The target of '{folder.folder}' is a mesh without shapes; give --target FILE.")
        other = load_model(folder.character("target"))
        return folder.add(pose, proposed(model, other, make_proposer(model, other, proposal), pose), replaces), note
    if target.suffix.lower() in POSED_MESH_SUFFIXES:
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


def _check_free(folder: KeyFolder, name: str, replaces: bool) -> None:
    """Check that a key of this name can be added, before the work is done."""
    stem = safe_stem(name)
    if not replaces and stem in {entry.name for entry in folder.entries()}:
        raise KeyTakenError(folder.folder, stem)


def _check_new(folder: KeyFolder, model: FaceModel, pose: Pose) -> None:
    """Check that no other key, nor the neutral face, is the same expression of the source."""
    own, coefficients = safe_stem(pose.name), applied(model, model.neutral(), pose)
    others = {entry.name: entry.source for entry in folder.entries() if entry.source is not None and entry.name != own}
    known = {"neutral": model.neutral()} if "neutral" not in (own, *others) else {}
    known |= {name: key_pose(path, model)[0] for name, path in others.items()}
    same = next((name for name, key in known.items() if same_expression(model, key, coefficients, folder.points)), None)
    if same is not None:
        raise FacePoserError(
            f"The key '{pose.name}' is the same expression of the source as '{same}' at all feature points; give "
            "another pose."
        )


def add_key_pose(
    folder: KeyFolder, pose: Pose, replaces: bool = False, proposal: Proposal = "auto", progress: Progress | None = None
) -> str:
    """Add the ``pose`` of the source with a proposal for the target, and return the name of the pair's files.

    A target that is a mesh without shapes gets no proposal: its key is left to the artist.

    Raises:
        FacePoserError: If the name is taken and ``replaces`` is False, or a file cannot be written.
    """
    _check_free(folder, checked_key_name(pose.name), replaces)
    answer = None
    if not folder.is_mesh:
        model, target = load_model(folder.character("source")), load_model(folder.character("target"))
        (progress or Progress()).at("Proposing the target's pose")
        answer = proposed(model, target, make_proposer(model, target, proposal), pose)
        (progress or Progress()).check()
    return folder.add(pose, answer, replaces)


def propose_again(folder: KeyFolder, name: str, proposal: Proposal = "auto") -> None:
    """Replace the target's pose of the key ``name`` by a proposal for the source's.

    Raises:
        FacePoserError: If the key is missing or a mesh, or a file cannot be written.
    """
    source = _editable(folder, name, "source")
    if not paths.is_file(source):
        raise FacePoserError(f"The key '{name}' has no source in '{source.parent}'; save a pose there first.")
    path = _editable(folder, name, "target")
    model, target = load_model(folder.character("source")), load_model(folder.character("target"))
    pose = read_pose_file(source)
    write_pose(path, proposed(model, target, make_proposer(model, target, proposal), pose))


def save_key(folder: KeyFolder, name: str, side: Side, model: FaceModel, coefficients: Array) -> None:
    """Write a pose of a character as its side of the key ``name``; it is then no proposal any more.

    Args:
        folder: The folder.
        name: Name of the key's files.
        side: Side that is replaced.
        model: Model of the pose.
        coefficients: The pose, shape (r,).

    Raises:
        FacePoserError: If the key is missing or a mesh, or the file cannot be written.
    """
    path = _editable(folder, name, side)
    old = Pose(name)
    for other in (path, *(folder.folder / side_ / f"{name}.json" for side_ in SIDES)):
        if paths.is_file(other):
            old = read_pose_file(other)
            break
    kept = tuple(tag for tag in old.tags if tag != PROPOSED)
    note = "" if PROPOSED in old.tags else old.note
    write_pose(path, replace(pose_of(model, coefficients, old.name, kept), note=note))


def _editable(folder: KeyFolder, name: str, side: Side) -> Path:
    """Return the pose file of one side of the key ``name``, which need not exist yet."""
    entry = next((entry for entry in folder.entries() if entry.name == name), None)
    if entry is None:
        raise FacePoserError(f"'{folder.folder}' has no key '{name}' any more.")
    path: Path | None = getattr(entry, side)
    if path is not None and path.suffix.lower() in POSED_MESH_SUFFIXES:
        raise FacePoserError(f"The key '{path}' is a mesh; change it in the program in which it was sculpted.")
    if side == "target" and folder.is_mesh:
        raise FacePoserError(
            f"The target of '{folder.folder}' is a mesh without shapes; sculpt its keys in another program."
        )
    return folder.folder / side / f"{name}.json"


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
                    f"The session '{path}' is of {session.model.character.label}, not of {model.character.label}; "
                    "give a pose of this character."
                )
            return pose_of(model, session.coefficients, name), session.remark
    from faceposer.interchange.reading import read_pose

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
    # Readers of all formats are not needed by the window's start.
    from faceposer.interchange.reading import read_performance

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
