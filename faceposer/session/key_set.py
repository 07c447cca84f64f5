"""All keys of a folder as they are now: their poses on both faces, and the transfer by them."""

import os
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.model.face_model import FaceModel
from faceposer.progress import Progress
from faceposer.session.key_entries import KeyFiles
from faceposer.session.key_files import KeyReader, load_side
from faceposer.session.key_folder import DESCRIPTION, SIDES, KeyFolder, Side
from faceposer.session.key_proposals import PROPOSED
from faceposer.session.keys import load_keys
from faceposer.transfer.examples import ExampleTransfer
from faceposer.transfer.source_heads import is_same_rig, on_character

Array = NDArray[np.float64]
#: Names, times of change and sizes of all files of a folder of keys, and of its characters.
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
        problem: Why the key is left out of the clone, one sentence, or "".
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
        models: The faces of both sides; that of a target without shapes has its keys as shapes, None if it has none.
        keys: The keys by name.
        transfer: The transfer by the keys to the target's own shapes, or of a target without any; None if the keys
            cannot be used.
        problem: Why they cannot be used, one sentence, or "".
        notes: Remarks on meshes that the shapes do not reach, or "".
        reader: What was read of the files.
    """

    folder: KeyFolder
    models: dict[Side, FaceModel | None]
    keys: tuple[ListedKey, ...]
    transfer: ExampleTransfer | None
    problem: str = ""
    notes: str = ""
    reader: KeyReader = field(default_factory=KeyReader, repr=False)

    @property
    def left_out(self) -> list[ListedKey]:
        """The keys that are left out of the clone."""
        return [key for key in self.keys if key.problem]

    def key(self, name: str) -> ListedKey | None:
        """Return the key with this name, if there is one."""
        return next((key for key in self.keys if key.name == name), None)

    def source_model(self) -> FaceModel:
        """Return the face that plays."""
        model = self.models["source"]
        assert model is not None
        return model

    def is_of(self, side: Side, model: FaceModel) -> bool:
        """Return True if ``model`` is the character of this side, with any head; others may have its name, too."""
        own = self.models[side]
        return own is not None and is_same_rig(own, model)

    def source_poses(self, model: FaceModel, poses: Array) -> Array:
        """Return ``poses``, (m, r), of the source with the head ``model`` as coefficients of the source."""
        return on_character(self.source_model(), model, poses)

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
    """Return the state of the files in a folder of keys and of its characters; what cannot be read is left out."""
    found: list[tuple[str, int, int]] = []
    for part in (None, *SIDES):
        with suppress(OSError), os.scandir(folder if part is None else folder / part) as entries:
            for entry in entries:
                if part is not None or entry.name == DESCRIPTION:
                    with suppress(OSError):
                        status = entry.stat()
                        found.append((f"{part}/{entry.name}", status.st_mtime_ns, status.st_size))
    with suppress(FacePoserError):
        keys = KeyFolder.read(folder)
        for side in SIDES:
            file = Path(keys.character(side))
            if file.suffix and paths.is_file(file):
                with suppress(OSError):
                    status = file.stat()
                    found.append((str(file), status.st_mtime_ns, status.st_size))
    return tuple(sorted(found))


def read_key_set(path: Path, progress: Progress | None = None, last: KeySet | None = None) -> KeySet:
    """Return the keys in the folder ``path``; those that cannot be used are among them, with the reason.

    Args:
        path: The folder.
        progress: Receives the progress.
        last: The keys as they were before, of which only files that have changed are read again.

    Raises:
        FacePoserError: If it is no folder of keys, or a character cannot be loaded.
        CancelledError: If the progress was cancelled.
    """
    progress = progress or Progress()
    folder = KeyFolder.read(path)
    reader = KeyReader(None if last is None else last.reader)
    progress.at("Reading keys")
    source = load_side(folder, "source")
    target = None if folder.is_mesh else load_side(folder, "target")
    loaded, problem, notes = None, "", ""
    try:
        # Results are poses of the target's own shapes, which a session can hold.
        loaded = load_keys(folder, "auto" if folder.is_mesh else "weights", reader=reader)
        source, target, notes = loaded.transfer.source, loaded.transfer.target, loaded.notes
    except FacePoserError as error:
        problem = str(error)
    left_out = {} if loaded is None else loaded.left_out
    known: dict[str, Array] = {}
    if loaded is not None and folder.is_mesh:
        known = {pair.name: pair.target for pair in (loaded.transfer.base, *loaded.transfer.pairs)}
    keys = []
    models: dict[Side, FaceModel | None] = {"source": source, "target": target}
    for entry in folder.entries():
        progress.check()
        before = None if last is None or last.folder.folder != folder.folder else last.key(entry.name)
        keys.append(_listed(entry, folder, models, known, reader, left_out.get(entry.name, ""), before))
    reader.forget_rest()
    transfer = None if loaded is None else loaded.transfer
    return KeySet(folder, models, tuple(keys), transfer, problem, notes, reader)


def _listed(
    files: KeyFiles,
    folder: KeyFolder,
    models: dict[Side, FaceModel | None],
    known: dict[str, Array],
    reader: KeyReader,
    reason: str,
    before: ListedKey | None,
) -> ListedKey:
    """Return a key.

    Args:
        files: Its files.
        folder: The folder.
        models: The faces of both sides.
        known: Poses of the target without shapes by name.
        reader: Reads the files.
        reason: Why the key is left out, if it is known.
        before: The key as it was before; of files that cannot be read now, title and kind are those of then.
    """
    poses: dict[Side, Array | None] = {"source": None, "target": None}
    title, tags, proposed, problem = files.name, set[str](), False, ""
    unread = False
    try:
        folder.complete(files)
    except FacePoserError as error:
        problem = str(error)
    for side in SIDES:
        path, model = (files.source if side == "source" else files.target), models[side]
        if path is None:
            continue
        if model is None or (side == "target" and folder.is_mesh):
            poses[side] = known.get(files.name)
            continue
        try:
            key = reader.read(path, model)
            poses[side] = key.coefficients
            title = key.title if side == "source" and key.title else title
            tags.update(key.tags)
            proposed = proposed or (side == "target" and PROPOSED in key.tags)
        except FacePoserError as error:
            problem, unread = problem or str(error), True
    kind = folder.kind_of(files.name, tags)
    if unread and before is not None:
        title, kind = (before.title if title == files.name else title), kind or before.kind
    return ListedKey(files, title, kind, poses, proposed, reason or problem)
