"""All keys of a folder as they are now: their poses on both faces, and the transfer by them."""

import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.model.face_model import FaceModel
from faceposer.poses.pose_file import read_pose
from faceposer.progress import Progress
from faceposer.session.key_folder import DESCRIPTION, SIDES, KeyFiles, KeyFolder, Side
from faceposer.session.key_proposals import PROPOSED
from faceposer.session.keys import key_pose, load_keys
from faceposer.session.opening import load_model
from faceposer.transfer.examples import NEUTRAL, ExampleTransfer

Array = NDArray[np.float64]
#: Names, times of change and sizes of all files of a folder of keys.
Stamp = tuple[tuple[str, int, int], ...]


@dataclass(frozen=True, eq=False)
class ListedKey:
    """A key of a folder.

    Attributes:
        files: Its files.
        title: Name for the user.
        kind: "expression", "viseme", "composed" or "".
        poses: Coefficients on the source and on the target, None for a side that is missing or cannot be read.
        proposed: True if the target's pose was proposed and not yet edited.
        problem: Why a side cannot be used, one sentence, or "".
    """

    files: KeyFiles
    title: str
    kind: str
    poses: dict[Side, Array | None]
    proposed: bool
    problem: str

    @property
    def name(self) -> str:
        """Name of its files without suffix."""
        return self.files.name


@dataclass(frozen=True, eq=False)
class KeySet:
    """The keys of a folder at one time.

    Attributes:
        folder: The folder.
        stamp: State of its files.
        models: The faces of both sides; that of a target without shapes has its keys as shapes, None if it has none.
        keys: The keys by name.
        transfer: The transfer by the keys to the target's own shapes, or of a target without any; None if the keys
            cannot be used.
        problem: Why they cannot be used, one sentence, or "".
        notes: Remarks on meshes that the shapes do not reach, or "".
    """

    folder: KeyFolder
    stamp: Stamp
    models: dict[Side, FaceModel | None]
    keys: tuple[ListedKey, ...]
    transfer: ExampleTransfer | None
    problem: str = ""
    notes: str = ""

    def key(self, name: str) -> ListedKey | None:
        """Return the key with this name, if there is one."""
        return next((key for key in self.keys if key.name == name), None)

    def source_model(self) -> FaceModel:
        """Return the face that plays."""
        model = self.models["source"]
        assert model is not None
        return model

    def is_of(self, side: Side, model: FaceModel) -> bool:
        """Return True if ``model`` is the character of this side, with any head."""
        own = self.models[side]
        return own is not None and own.character.name == model.character.name

    def source_poses(self, model: FaceModel, poses: Array) -> Array:
        """Return ``poses``, (m, r), of the source with the head ``model`` as coefficients of the source."""
        source = self.source_model()
        if model is source:
            return poses
        return (poses @ model.subspace.directions.T) @ source.subspace.projection.T

    def strengths(self, pose: Array) -> dict[str, float]:
        """Return the weight of each key in a pose of the source, shape (r,): the largest over the regions."""
        if self.transfer is None:
            return {}
        found = np.max([weights[0, 1:] for weights in self._spread(pose)], axis=0)
        return {pair.name: float(value) for pair, value in zip(self.transfer.pairs, found, strict=True)}

    def _spread(self, pose: Array) -> list[Array]:
        """Return the weights of all keys in each region, the base first; keys that share a place share its weight."""
        assert self.transfer is not None
        weights = self.transfer.weights(pose[None])
        return [block[:, region.members] for block, region in zip(weights, self.transfer.regions, strict=True)]


def stamp_of(folder: Path) -> Stamp:
    """Return the state of the files in a folder of keys; files that cannot be read are left out."""
    found: list[tuple[str, int, int]] = []
    for part in (None, *SIDES):
        with suppress(OSError), os.scandir(folder if part is None else folder / part) as entries:
            for entry in entries:
                if part is not None or entry.name == DESCRIPTION:
                    with suppress(OSError):
                        status = entry.stat()
                        found.append((f"{part}/{entry.name}", status.st_mtime_ns, status.st_size))
    return tuple(sorted(found))


def read_key_set(path: Path, progress: Progress | None = None) -> KeySet:
    """Return the keys in the folder ``path``; those that cannot be used are among them, with the reason.

    Raises:
        FacePoserError: If it is no folder of keys, or a character cannot be loaded.
        CancelledError: If the progress was cancelled.
    """
    progress = progress or Progress()
    stamp = stamp_of(path)
    folder = KeyFolder.read(path)
    progress.at("Reading keys")
    source = load_model(folder.character("source"))
    target = None if folder.is_mesh else load_model(folder.character("target"))
    loaded, problem, notes = None, "", ""
    kinds: Mapping[str, str] = {}
    try:
        # Results are poses of the target's own shapes, which a session can hold.
        loaded = load_keys(folder, "auto" if folder.is_mesh else "weights", source=source)
        target, notes = loaded.transfer.target, loaded.notes
        kinds = folder.kinds()
    except FacePoserError as error:
        problem = str(error)
    known = {} if loaded is None else {pair.name: pair.target for pair in loaded.transfer.pairs}
    keys = []
    models: dict[Side, FaceModel | None] = {"source": source, "target": target}
    for entry in folder.entries():
        progress.check()
        key = _listed(entry, kinds.get(entry.name, ""), models, folder.is_mesh)
        if folder.is_mesh and target is not None:
            key.poses["target"] = target.neutral() if entry.name.casefold() == NEUTRAL else known.get(entry.name)
        keys.append(key)
    return KeySet(folder, stamp, models, tuple(keys), None if loaded is None else loaded.transfer, problem, notes)


def _listed(files: KeyFiles, kind: str, models: dict[Side, FaceModel | None], is_mesh: bool) -> ListedKey:
    poses: dict[Side, Array | None] = {"source": None, "target": None}
    title, proposed, problem = files.name, False, ""
    for side in SIDES:
        path, model = (files.source if side == "source" else files.target), models[side]
        if path is None:
            problem = problem or f"The key has no {side}."
            continue
        try:
            if path.suffix.lower() == ".json":
                pose = read_pose(path)
                title = pose.name if side == "source" else title
                proposed = proposed or (side == "target" and PROPOSED in pose.tags)
            if model is not None and not (is_mesh and side == "target"):
                poses[side] = key_pose(path, model)[0]
        except FacePoserError as error:
            problem = problem or str(error)
    return ListedKey(files, title, kind, poses, proposed, problem)
