"""Keys of a folder that can be used together, and why others are left out."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh_io import POSED_MESH_SUFFIXES
from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel
from faceposer.session.key_entries import KeyFiles
from faceposer.session.key_files import KeyReader, key_displacements
from faceposer.session.key_folder import COMPOSED, KeyFolder
from faceposer.transfer.examples import NEUTRAL, check_motion, earlier_same
from faceposer.transfer.keyed_model import check_size

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class UsableKeys:
    """The keys of a folder that can be used.

    Attributes:
        files: Their files, by name.
        sources: Coefficients on the source of each, shape (r,).
        displacements: Displacements of the target's vertices by name, (N, 3) each, if it is a mesh without shapes.
        left_out: Why each of the other keys cannot be used, one sentence, by name.
    """

    files: list[KeyFiles]
    sources: list[Array]
    displacements: dict[str, Array]
    left_out: dict[str, str]


def usable_keys(
    folder: KeyFolder, source: FaceModel, character: Character, target: FaceModel | None, reader: KeyReader
) -> UsableKeys:
    """Return the keys of ``folder`` without those that lack a side, cannot be read, or are an expression of another.

    Of keys with one expression, the first by name is used, and a composed one only if there is no other.

    Args:
        folder: The folder.
        source: The face that plays.
        character: The character that follows.
        target: Its model, or None for a mesh without shapes.
        reader: Reads the files.

    Raises:
        FacePoserError: If no key can be used, or there are too many for the memory.
    """
    entries = folder.entries()
    if not entries:
        raise FacePoserError(f"'{folder.folder}' has no keys; add a pair of poses.")
    if target is None:
        check_size(len(entries), len(character.vertices))
    left_out: dict[str, str] = {}
    sources: dict[str, Array] = {}
    composed: set[str] = set()
    displacements: dict[str, Array] = {}
    for entry in entries:
        try:
            key = folder.complete(entry)
            read = reader.read(key[0], source)
            _check_pose(entry.name, "source", source, read.coefficients, read.error)
            if target is None:
                displacements[entry.name] = _displacements(entry.name, key[1], character, folder.character("target"))
            else:
                answer = reader.read(key[1], target)
                _check_pose(entry.name, "target", target, answer.coefficients, answer.error)
            sources[entry.name] = read.coefficients
            if COMPOSED in read.tags:
                composed.add(entry.name)
        except FacePoserError as error:
            left_out[entry.name] = str(error)
    left_out |= _repeated(folder, source, sources, composed)
    files = [entry for entry in entries if entry.name not in left_out]
    if not files:
        reason = next(iter(left_out.values()))
        raise FacePoserError(reason if len(left_out) == 1 else f"No key in '{folder.folder}' can be used. {reason}")
    return UsableKeys(files, [sources[entry.name] for entry in files], displacements, left_out)


def _check_pose(name: str, side: str, model: FaceModel, coefficients: Array, error: float) -> None:
    """Check that a pose, whose mesh is at most ``error`` from it, is a face."""
    moved = np.abs(model.instance(coefficients) - model.character.vertices).max() + error
    check_motion(name, side, moved, model.character)


def _displacements(name: str, path: Path, character: Character, what: str) -> Array:
    if path.suffix.lower() not in POSED_MESH_SUFFIXES:
        raise FacePoserError(
            f"The key '{path}' is a pose, but the target is a mesh without shapes ('{what}'); give a mesh (.obj)."
        )
    moved = key_displacements(path, character)
    check_motion(name, "target", float(np.abs(moved).max(initial=0.0)), character)
    return moved


def _repeated(folder: KeyFolder, source: FaceModel, sources: dict[str, Array], composed: set[str]) -> dict[str, str]:
    """Return why keys are left out that are the same expression of the source as another one, by name."""
    base = next((name for name in sources if name.casefold() == NEUTRAL), "")
    order = sorted((name for name in sources if name != base), key=lambda name: (name in composed, name))
    poses = np.array([sources[base] if base else source.neutral(), *(sources[name] for name in order)])
    reasons: dict[str, str] = {}
    for name, same in zip(order, earlier_same(source, poses, folder.points)[1:], strict=True):
        if same is not None:
            reasons[name] = _repetition(name, order[same - 1] if same else base)
    return reasons


def _repetition(name: str, other: str) -> str:
    """Return why the key ``name`` is left out, which repeats the key ``other``, or, if it is "", the neutral face."""
    if not other:
        return f"The key '{name}' is the neutral face of the source at all feature points; change or remove it."
    return (
        f"The key '{name}' is the same expression of the source as '{other}' at all feature points; change or remove "
        "one of them."
    )
