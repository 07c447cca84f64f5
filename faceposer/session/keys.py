"""Transfer by the key poses of a folder."""

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.files import paths
from faceposer.geometry.mesh import first_unusable
from faceposer.geometry.mesh_io import POSED_MESH_SUFFIXES, read_mesh
from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel
from faceposer.poses.applying import applied
from faceposer.poses.pose_file import read_pose
from faceposer.session.key_folder import KeyFiles, KeyFolder
from faceposer.session.opening import load_model
from faceposer.transfer.examples import ExampleTransfer, KeyPair
from faceposer.transfer.key_parameters import Regions
from faceposer.transfer.keyed_model import character_of_mesh, check_size, keyed_model

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
    """

    transfer: ExampleTransfer
    has_own_shapes: bool
    notes: str = ""


def load_keys(
    folder: KeyFolder, form: Form = "auto", regions: Regions | None = None, source: FaceModel | None = None
) -> LoadedKeys:
    """Return the transfer by the keys in ``folder``.

    Args:
        folder: The folder.
        form: "weights" for the nearest poses of the target's shapes, "meshes" for blends of the keys as they are,
            "auto" for weights if they are exact.
        regions: Regions that are cloned separately; None for those of the folder.
        source: Model of the source, if it is loaded.

    Raises:
        FacePoserError: If a file is missing or wrong; the message names it.
    """
    source = source or load_model(folder.character("source"))
    files = folder.pairs()
    if not files:
        raise FacePoserError(f"'{folder.folder}' has no keys; add pairs of poses, or create the folder with keys init.")
    sources = [key_pose(_path(entry.source), source)[0] for entry in files]
    rest, target, errors = _targets(folder, files, form)
    transfer = ExampleTransfer(
        source,
        target,
        [KeyPair(entry.name, key, pose) for entry, key, pose in zip(files, sources, rest, strict=True)],
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
    return LoadedKeys(transfer, not folder.is_mesh and target is load_model(folder.character("target")), note)


def _path(path: Path | None) -> Path:
    assert path is not None
    return path


def key_pose(path: Path, model: FaceModel) -> tuple[Array, float]:
    """Return the coefficients of the pose or mesh ``path``, and the largest distance of a vertex from it.

    Raises:
        FacePoserError: If the file cannot be used; the message names it.
    """
    try:
        if path.suffix.lower() == ".json":
            return applied(model, model.neutral(), read_pose(path)), 0.0
        # Readers of all formats are not needed by the window's start.
        from faceposer.interchange.reading import pose_of_mesh

        coefficients = pose_of_mesh(read_mesh(path), model, str(path)).coefficients
        moved = key_displacements(path, model.character)
        reached = model.instance(coefficients) - model.character.vertices
        return coefficients, float(np.linalg.norm(moved - reached, axis=1).max())
    except FacePoserError as error:
        if str(path) in str(error):
            raise
        raise FacePoserError(f"The key '{path}' cannot be used: {error}") from error


def _targets(folder: KeyFolder, files: list[KeyFiles], form: Form) -> tuple[list[Array], FaceModel, dict[str, float]]:
    """Return the target's coefficients in each key, its model, and the errors of keys that its shapes do not reach."""
    if folder.is_mesh:
        path = Path(folder.character("target"))
        character = character_of_mesh(read_mesh(path), path.stem)
        return *_meshes(character, None, files, str(path)), {}
    model = load_model(folder.character("target"))
    errors: dict[str, float] = {}
    found: list[Array] = []
    for entry in files:
        if form == "meshes":
            break
        coefficients, error = key_pose(_path(entry.target), model)
        found.append(coefficients)
        if error > _EXACT:
            errors[entry.name] = error
    if form == "meshes" or (form == "auto" and errors):
        return *_meshes(model.character, model, files, f"character {model.character.label}"), {}
    return found, model, errors


def _meshes(
    character: Character, model: FaceModel | None, files: list[KeyFiles], what: str
) -> tuple[list[Array], FaceModel]:
    """Return the coefficients of each key in a model whose shapes are the keys, and this model."""
    check_size(len(files), len(character.vertices))
    displacements = []
    for entry in files:
        path = _path(entry.target)
        if path.suffix.lower() != ".json":
            displacements.append(key_displacements(path, character))
        elif model is not None:
            coefficients, _ = key_pose(path, model)
            displacements.append((model.instance(coefficients) - character.vertices).astype(np.float64))
        else:
            raise FacePoserError(
                f"The key '{path}' is a pose, but the target is a mesh without shapes ('{what}'); give a mesh (.obj)."
            )
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


def key_displacements(path: Path, character: Character) -> Array:
    """Return the displacements of the vertices of ``character`` in the mesh ``path``, shape (N, 3).

    Raises:
        FacePoserError: If the file cannot be read, has another topology, or numbers that are not finite.
    """
    mesh = read_mesh(path)
    origin = character.origin
    count = len(character.vertices) if origin is None else len(origin.neutral)
    if len(mesh.vertices) != count:
        raise FacePoserError(
            f"The key '{path}' has {counted(len(mesh.vertices), 'vertex', 'vertices')}, but '{character.title}' has "
            f"{count}; sculpt keys on its neutral mesh, without adding, merging or removing vertices."
        )
    row = first_unusable(mesh.vertices)
    if row is not None:
        raise FacePoserError(f"The key '{path}' has a vertex {row + 1} that is not finite; export it again.")
    if origin is not None:
        return origin.character_vertices(mesh.vertices, len(character.vertices))
    return mesh.vertices - character.vertices


def check_characters(folder: KeyFolder, source: FaceModel, target: str) -> None:
    """Check that the keys of ``folder`` are those of the model ``source`` and of the ``target``, a name or file.

    Raises:
        FacePoserError: If they are those of others.
    """
    expected = load_model(folder.character("source"))
    if expected is not source and expected.character.name != source.character.name:
        raise FacePoserError(
            f"The keys in '{folder.folder}' are of {expected.character.label}, but the source is "
            f"{source.character.label}; give keys of this character."
        )
    own = folder.character("target")
    same = paths.same_file(own, target) if folder.is_mesh or Path(target).suffix else own == target
    if not same:
        raise FacePoserError(
            f"The keys in '{folder.folder}' are for {_label(own)}, not for {_label(target)}; give keys of this "
            "character."
        )


def _label(character: str) -> str:
    """Return the label of the character with this name or file, or the file of a mesh or of one that is missing."""
    if Path(character).suffix.lower() in POSED_MESH_SUFFIXES:
        return f"'{character}'"
    with suppress(FacePoserError):
        return load_model(character).character.label
    return f"'{character}'"
