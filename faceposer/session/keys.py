"""Transfer by the key poses of a folder."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.files import paths
from faceposer.geometry.mesh_io import POSED_MESH_SUFFIXES
from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel
from faceposer.session.key_entries import KeyFiles
from faceposer.session.key_files import KeyReader, character_of, key_displacements, load_side
from faceposer.session.key_folder import DESCRIPTION, KeyFolder
from faceposer.session.opening import load_model
from faceposer.session.usable_keys import UsableKeys, usable_keys
from faceposer.transfer.examples import ExampleTransfer, KeyPair
from faceposer.transfer.key_parameters import Regions
from faceposer.transfer.keyed_model import check_size, keyed_model
from faceposer.transfer.source_heads import is_same_rig

Array = NDArray[np.float64]
#: Form of the result: weights of the target's shapes, or weights of the keys, which have the keys' meshes as shapes.
Form = Literal["auto", "weights", "meshes"]

# A mesh farther than this from all poses of a character, in centimetres, needs a form of its own.
_EXACT = 0.01


@dataclass(frozen=True, eq=False)
class LoadedKeys:
    """The keys of a folder, ready to clone.

    Attributes:
        transfer: The transfer.
        has_own_shapes: True if results are poses of the target's own shapes, False if they are blends of meshes.
        notes: Remarks for the user on meshes that the shapes do not reach, or "".
        left_out: Why keys of the folder are left out, one sentence each, by name.
    """

    transfer: ExampleTransfer
    has_own_shapes: bool
    notes: str = ""
    left_out: Mapping[str, str] = field(default_factory=dict)

    @property
    def remarks(self) -> str:
        """The notes, and how many keys are left out, with the first reason."""
        said = [self.notes] if self.notes else []
        if self.left_out:
            said.append(f"{counted(len(self.left_out), 'key')} left out. {next(iter(self.left_out.values()))}")
        return " ".join(said)


def load_keys(
    folder: KeyFolder, form: Form = "auto", regions: Regions | None = None, reader: KeyReader | None = None
) -> LoadedKeys:
    """Return the transfer by the keys in ``folder``, from its source as it is; see ``HeadTransfer`` for other heads.

    Keys that cannot be used are left out.

    Args:
        folder: The folder.
        form: "weights" for the nearest poses of the target's shapes, "meshes" for blends of the keys as they are,
            "auto" for weights if they are exact.
        regions: Regions that are cloned separately; None for those of the folder.
        reader: Reader that may have read some of the keys.

    Raises:
        FacePoserError: If a character is missing or wrong, or no key can be used; the message names the file.
    """
    source = load_side(folder, "source")
    check_points(folder, source.character)
    reader = reader or KeyReader()
    character, model = character_of(folder, "target")
    usable = usable_keys(folder, source, character, model, reader)
    rest, target, own, errors = _targets(folder, usable, character, model, form, reader)
    transfer = ExampleTransfer(
        source,
        target,
        [KeyPair(entry.name, key, pose) for entry, key, pose in zip(usable.files, usable.sources, rest, strict=True)],
        folder.points,
        regions or folder.regions,
        folder.threshold,
    )
    note = ""
    if errors:
        worst = max(errors, key=errors.__getitem__)
        note = (
            f"{counted(len(errors), 'key')} of the target cannot be reached by its shapes; the error is up to "
            f"{10.0 * errors[worst]:.1f} mm, in '{worst}'."
        )
    return LoadedKeys(transfer, own, note, usable.left_out)


def _path(path: Path | None) -> Path:
    assert path is not None
    return path


def check_points(folder: KeyFolder, source: Character) -> None:
    """Check that the ``source`` has the feature points that the description of the keys names.

    Raises:
        FacePoserError: If it lacks one.
    """
    unknown = [name for name in folder.points or () if name not in source.feature_points]
    if unknown:
        raise FacePoserError(
            f"'{folder.folder / DESCRIPTION}': points names '{unknown[0]}', but the source '{source.name}' has no "
            f"such feature point; its points are {', '.join(source.feature_points) or 'none'}."
        )


def _targets(
    folder: KeyFolder,
    usable: UsableKeys,
    character: Character,
    model: FaceModel | None,
    form: Form,
    reader: KeyReader,
) -> tuple[list[Array], FaceModel, bool, dict[str, float]]:
    """Return the target's coefficients in each key, its model, and the errors of keys that its shapes do not reach.

    The third value is True if the model has the target's own shapes.
    """
    files = usable.files
    if model is None:
        displacements = [usable.displacements[entry.name] for entry in files]
        return *_meshes(character, displacements, files, folder.character("target")), False, {}
    errors: dict[str, float] = {}
    found: list[Array] = []
    for entry in files:
        if form == "meshes":
            break
        key = reader.read(_path(entry.target), model)
        found.append(key.coefficients)
        if key.error > _EXACT:
            errors[entry.name] = key.error
    if form == "meshes" or (form == "auto" and errors):
        check_size(len(files), len(character.vertices))
        displacements = [_displacements(_path(entry.target), model, reader) for entry in files]
        return *_meshes(character, displacements, files, f"character {character.label}"), False, {}
    return found, model, True, errors


def _displacements(path: Path, model: FaceModel, reader: KeyReader) -> Array:
    """Return the displacements of the target's vertices in a key, shape (N, 3)."""
    if path.suffix.lower() != ".json":
        return key_displacements(path, model.character)
    moved = model.instance(reader.read(path, model).coefficients) - model.character.vertices
    return moved.astype(np.float64)


def _meshes(
    character: Character, displacements: list[Array], files: list[KeyFiles], what: str
) -> tuple[list[Array], FaceModel]:
    """Return the coefficients of each key in a model whose shapes are the keys, and this model."""
    kept = [
        (entry.name, moved)
        for entry, moved in zip(files, displacements, strict=True)
        if np.abs(moved).max(initial=0.0) > 0.0
    ]
    if not kept:
        raise FacePoserError(f"No key, such as '{files[0].target}', moves the {what}; sculpt the targets first.")
    keyed = keyed_model(character, [name for name, _ in kept], [moved for _, moved in kept])
    shapes = dict(zip(keyed.character.shape_names, np.eye(len(kept)), strict=True))
    return [keyed.coefficients_of(shapes.get(entry.name, np.zeros(len(kept)))) for entry in files], keyed


def check_characters(folder: KeyFolder, source: FaceModel, target: str) -> None:
    """Check that the keys of ``folder`` are those of the model ``source`` and of the ``target``, a name or file.

    Raises:
        FacePoserError: If they are those of others.
    """
    expected = load_side(folder, "source")
    if expected.character.name != source.character.name:
        raise FacePoserError(
            f"The keys in '{folder.folder}' are of {expected.character.label}, but the source is "
            f"{source.character.label}; give keys of this character."
        )
    check_same_rig(folder, expected, source)
    own = folder.character("target")
    same = paths.same_file(own, target) if folder.is_mesh or Path(target).suffix else own == target
    if not same:
        raise FacePoserError(
            f"The keys in '{folder.folder}' are for {_label(own)}, not for {_label(target)}; give keys of this "
            "character."
        )


def check_same_rig(folder: KeyFolder, keys: FaceModel, source: FaceModel) -> None:
    """Check that the ``source`` has the shapes of the character that plays in the keys of ``folder``.

    Raises:
        FacePoserError: If it is another character of the same name, or an earlier version.
    """
    if not is_same_rig(keys, source):
        counts = (len(keys.character.shape_names), len(source.character.shape_names))
        differ = f"{counts[0]}, not {counts[1]}, shapes" if counts[0] != counts[1] else "other shapes"
        raise FacePoserError(
            f"The keys in '{folder.folder}' are of another character {keys.character.label}, with {differ}; make keys "
            "of this one."
        )


def _label(character: str) -> str:
    """Return the label of the character with this name or file, or the file of a mesh or of one that is missing."""
    if Path(character).suffix.lower() in POSED_MESH_SUFFIXES:
        return f"'{character}'"
    with suppress(FacePoserError):
        return load_model(character).character.label
    return f"'{character}'"
