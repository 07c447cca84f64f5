"""Changes of the pairs in a folder of keys: additions from files and from the frames of an animation, other names."""

import shutil
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.files.atomic import atomic_files
from faceposer.geometry.mesh_io import POSED_MESH_SUFFIXES
from faceposer.model.face_model import FaceModel
from faceposer.poses.applying import applied, pose_of
from faceposer.poses.library import safe_stem
from faceposer.poses.pose_file import Pose, pose_text, write_pose
from faceposer.poses.pose_file import read_pose as read_pose_file
from faceposer.progress import Progress
from faceposer.session.file_kinds import kind_of
from faceposer.session.key_entries import KeyTakenError, checked_key_name, delete_keys
from faceposer.session.key_files import character_of, key_displacements, load_side, read_key
from faceposer.session.key_folder import COMPOSED, SIDES, KeyFolder, Side
from faceposer.session.key_proposals import PROPOSED, Proposal, make_proposer, proposed
from faceposer.session.keys import check_points, load_keys
from faceposer.session.opening import open_session
from faceposer.transfer.examples import NEUTRAL, same_expression
from faceposer.transfer.key_coverage import HelpfulFrame, chosen_frames
from faceposer.transfer.source_heads import is_same_rig

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
    model = load_side(folder, "source")
    check_points(folder, model.character)
    checked = checked_key_name(name)
    _check_free(folder, checked, replaces)
    pose, note = _pose_in(source, model, checked, frame)
    _check_new(folder, safe_stem(pose.name), applied(model, model.neutral(), pose))
    if target is None:
        if folder.is_mesh:
            raise FacePoserError(f"The target of '{folder.folder}' is a mesh without shapes; give --target FILE.")
        other = load_side(folder, "target")
        return folder.add(pose, proposed(model, other, make_proposer(model, other, proposal), pose), replaces), note
    if target.suffix.lower() in POSED_MESH_SUFFIXES:
        key_displacements(target, character_of(folder, "target")[0])
        return folder.add(pose, target, replaces), note
    if folder.is_mesh:
        raise FacePoserError(f"The target of '{folder.folder}' is a mesh without shapes; give a mesh, not '{target}'.")
    answer, _ = _pose_in(target, load_side(folder, "target"), pose.name, 0)
    return folder.add(pose, answer, replaces), note


def _check_free(folder: KeyFolder, name: str, replaces: bool) -> None:
    """Check that a key of this name can be added, before the work is done."""
    stem = safe_stem(name)
    if not replaces and folder.entry(stem) is not None:
        raise KeyTakenError(folder.folder, stem)


def _check_new(folder: KeyFolder, own: str, coefficients: Array) -> None:
    """Check that no key besides ``own``, nor the neutral face, is an expression of the source, shape (r,)."""
    model = load_side(folder, "source")
    others = {entry.name: entry.source for entry in folder.entries() if entry.source is not None and entry.name != own}
    known = {"": model.neutral()} if not any(name.casefold() == NEUTRAL for name in (own, *others)) else {}
    for name, path in others.items():
        # What cannot be read is told by the check of the folder.
        with suppress(FacePoserError):
            known[name] = read_key(path, model).coefficients
    same = next((name for name, key in known.items() if same_expression(model, key, coefficients, folder.points)), None)
    if same is not None:
        what = f"the same expression of the source as '{same}'" if same else "the neutral face of the source"
        raise FacePoserError(f"The key '{own}' is {what} at all feature points; give another pose.")


def add_key_pose(
    folder: KeyFolder, pose: Pose, replaces: bool = False, proposal: Proposal = "auto", progress: Progress | None = None
) -> str:
    """Add the ``pose`` of the source with a proposal for the target, and return the name of the pair's files.

    A target that is a mesh without shapes gets no proposal: its key is left to the artist.

    Raises:
        FacePoserError: If the name is taken and ``replaces`` is False, another key is this expression, or a file cannot
            be written.
    """
    _check_free(folder, checked_key_name(pose.name), replaces)
    model = load_side(folder, "source")
    _check_new(folder, safe_stem(pose.name), applied(model, model.neutral(), pose))
    answer = None
    if not folder.is_mesh:
        target = load_side(folder, "target")
        (progress or Progress()).at("Proposing the target's pose")
        answer = proposed(model, target, make_proposer(model, target, proposal), pose)
        (progress or Progress()).check()
    return folder.add(pose, answer, replaces)


def rename_key(folder: KeyFolder, name: str, new: str) -> str:
    """Rename the key ``name``, its poses included, and return the new name of its files.

    Raises:
        FacePoserError: If the key is missing, another one has the name, or a file cannot be read or written; then
            nothing has changed.
    """
    title = checked_key_name(new)
    stem = safe_stem(title)
    entry = folder.existing(name)
    other = next((one.name for one in folder.entries() if one.name.casefold() == stem.casefold()), name)
    if other != name:
        raise FacePoserError(f"'{folder.folder}' already has a key '{other}'; choose another name.")
    old = [path for path in (entry.source, entry.target) if path is not None]
    new_files = [path.with_name(f"{stem}{path.suffix}") for path in old]
    with atomic_files(new_files, "key") as temporaries:
        for path, file, temporary in zip(old, new_files, temporaries, strict=True):
            if path.suffix.lower() == ".json":
                text = pose_text(file, read_pose_file(path).renamed(title))
                temporary.write_text(text, encoding="utf-8", newline="\n")
            else:
                shutil.copyfile(path, temporary)
    listed = replace(
        folder,
        expressions=tuple(stem if one == name else one for one in folder.expressions),
        visemes=tuple(stem if one == name else one for one in folder.visemes),
    )
    if listed != folder:
        try:
            listed.write()
        except FacePoserError:
            delete_keys(file for path, file in zip(old, new_files, strict=True) if not paths.same_file(path, file))
            raise
    # Where the system ignores case, a file may have got its new name already.
    delete_keys(path for path, file in zip(old, new_files, strict=True) if not paths.same_file(path, file))
    return stem


def propose_again(folder: KeyFolder, name: str, proposal: Proposal = "auto") -> None:
    """Replace the target's pose of the key ``name`` by a proposal for the source's.

    Raises:
        FacePoserError: If the key is missing or a mesh, or a file cannot be written.
    """
    source = _editable(folder, name, "source")
    if not paths.is_file(source):
        raise FacePoserError(f"The key '{name}' has no source in '{source.parent}'; save a pose there first.")
    path = _editable(folder, name, "target")
    model, target = load_side(folder, "source"), load_side(folder, "target")
    pose = read_pose_file(source)
    write_pose(path, proposed(model, target, make_proposer(model, target, proposal), pose))


def save_key(folder: KeyFolder, name: str, side: Side, model: FaceModel, coefficients: Array) -> None:
    """Write a pose of a character as its side of the key ``name``; it is then neither a proposal nor composed any more.

    Name, tags and note stay. A file that cannot be read, which the pose replaces, has none.

    Args:
        folder: The folder.
        name: Name of the key's files.
        side: Side that is replaced.
        model: Model of the pose.
        coefficients: The pose, shape (r,).

    Raises:
        FacePoserError: If the key is missing or a mesh, another key is this expression, or the file cannot be written.
    """
    path = _editable(folder, name, side)
    old = _present_pose(folder, name, side)
    kept = tuple(tag for tag in old.tags if tag not in (PROPOSED, COMPOSED))
    note = "" if PROPOSED in old.tags else old.note
    new = replace(pose_of(model, coefficients, old.name, kept), note=note)
    if side == "source":
        own = load_side(folder, "source")
        _check_new(folder, name, applied(own, own.neutral(), new))
    write_pose(path, new)


def _present_pose(folder: KeyFolder, name: str, side: Side) -> Pose:
    """Return the pose of one side of the key ``name``, else that of the other side, else an empty one."""
    entry = folder.entry(name)
    for one in (side, *SIDES):
        path: Path | None = getattr(entry, one)
        if path is not None and path.suffix.lower() == ".json":
            with suppress(FacePoserError):
                return read_pose_file(path)
    return Pose(name)


def _editable(folder: KeyFolder, name: str, side: Side) -> Path:
    """Return the pose file of one side of the key ``name``, which need not exist yet."""
    entry = folder.entry(name)
    if entry is None:
        raise FacePoserError(f"'{folder.folder}' has no key '{name}' any more.")
    path: Path | None = getattr(entry, side)
    if path is not None and path.suffix.lower() in POSED_MESH_SUFFIXES:
        raise FacePoserError(f"The key '{path}' is a mesh; change it in the program in which it was sculpted.")
    if side == "target" and folder.is_mesh:
        raise FacePoserError(
            f"The target of '{folder.folder}' is a mesh without shapes; sculpt its keys in another program."
        )
    return folder.place(entry, name, side, ".json")


def _pose_in(path: Path, model: FaceModel, name: str, frame: int) -> tuple[Pose, str]:
    """Return the pose in a pose file, a session, weights or a mesh, under a new name, and a remark."""
    if path.suffix.lower() == ".json":
        kind = kind_of(path)
        if kind == "pose":
            pose = read_pose_file(path).renamed(name)
            # Composed keys are made again; this one is the artist's.
            return replace(pose, tags=tuple(tag for tag in pose.tags if tag != COMPOSED)), ""
        if not kind:
            session = open_session(str(path))
            session.wait()
            if not is_same_rig(session.model, model):
                raise FacePoserError(
                    f"The session '{path}' is of {session.model.character.label}, not of {model.character.label} with "
                    f"the {len(model.character.shape_names)} shapes of the keys; give a pose of this character."
                )
            return pose_of(session.model, session.coefficients, name), session.remark
    from faceposer.interchange.reading import read_pose

    read = read_pose(path, model, frame)
    return pose_of(model, read.coefficients, name), read.note


def choose_keys(
    folder: KeyFolder, take: Path, count: int, progress: Progress | None = None
) -> list[tuple[str, HelpfulFrame]]:
    """Add the frames of ``take`` that help most as keys, with proposals for the target, and return their names.

    Raises:
        FacePoserError: If the take cannot be read, the target is a mesh without shapes, or there are too many keys.
    """
    progress = progress or Progress()
    if folder.is_mesh:
        raise FacePoserError(
            f"The target of '{folder.folder}' is a mesh without shapes, for which nothing is proposed; add keys one "
            "by one."
        )
    folder.check_room(count)
    model, target = load_side(folder, "source"), load_side(folder, "target")
    check_points(folder, model.character)
    # Readers of all formats are not needed by the window's start.
    from faceposer.interchange.reading import read_performance

    poses = read_performance(take, model).performance.coefficients
    files = folder.entries()
    taken = {entry.name for entry in files}
    loaded = load_keys(folder).transfer if files else None
    keys = np.array([pair.source for pair in loaded.pairs]) if loaded else np.zeros((0, model.n_coefficients))
    base = loaded.base.source if loaded else None
    proposer = make_proposer(model, target)
    added: list[tuple[str, HelpfulFrame]] = []
    chosen = chosen_frames(model, keys, poses, count, folder.points, folder.regions, folder.threshold, base)
    for helpful in chosen:
        progress.check()
        name = f"{safe_stem(take.stem)[:40]} {helpful.frame}"
        while safe_stem(name) in taken:
            name += "b"
        pose = pose_of(model, poses[helpful.frame], name, ("frame",))
        added.append((folder.add(pose, proposed(model, target, proposer, pose)), helpful))
        taken.add(added[-1][0])
        progress.at("Adding keys", len(added) / count)
    return added
