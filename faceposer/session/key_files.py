"""Files of key poses: poses and meshes of one side, read once until they change."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.geometry.mesh import first_unusable
from faceposer.geometry.mesh_io import read_mesh
from faceposer.geometry.polygon_mesh import PolygonMesh
from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel
from faceposer.poses.applying import applied
from faceposer.poses.pose_file import read_pose
from faceposer.session.key_folder import DESCRIPTION, KeyFolder, Side
from faceposer.session.opening import load_model
from faceposer.transfer.keyed_model import character_of_mesh

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ReadKey:
    """One side of a key.

    Attributes:
        coefficients: The pose, shape (r,); the nearest one for a mesh.
        error: Largest distance of a vertex of the mesh from it; 0 for poses.
        title: Name of the pose, or "" for a mesh.
        tags: Tags of the pose.
    """

    coefficients: Array
    error: float = 0.0
    title: str = ""
    tags: tuple[str, ...] = ()


class KeyReader:
    """Reads sides of keys, each file once until it changes."""

    def __init__(self, last: "KeyReader | None" = None) -> None:
        """Read what the reader ``last``, if there is one, has not read yet."""
        self._last = {} if last is None else last._read
        self._read: dict[tuple[Path, int], tuple[tuple[int, ...], FaceModel, ReadKey | str]] = {}

    def read(self, path: Path, model: FaceModel) -> ReadKey:
        """Return the pose or mesh ``path`` of ``model``.

        Raises:
            FacePoserError: If the file cannot be used; the message names it.
        """
        place, stamp = (path, id(model)), _stamp(path)
        known = self._read.get(place) or self._last.get(place)
        # The model is kept, so that no other one can get its identifier.
        if known is None or known[0] != stamp or not stamp:
            found: ReadKey | str
            try:
                found = read_key(path, model)
            except FacePoserError as error:
                found = str(error)
            known = (stamp, model, found)
        self._read[place] = known
        if isinstance(known[2], str):
            raise FacePoserError(known[2])
        return known[2]

    def forget_rest(self) -> None:
        """Forget what the last reader has read and this one has not."""
        self._last = {}


def _stamp(path: Path) -> tuple[int, ...]:
    try:
        status = path.stat()
    except OSError:
        return ()
    return status.st_mtime_ns, status.st_size, status.st_ino


def read_key(path: Path, model: FaceModel) -> ReadKey:
    """Return the pose or mesh ``path`` of ``model``.

    Raises:
        FacePoserError: If the file cannot be used; the message names it.
    """
    try:
        if path.suffix.lower() == ".json":
            pose = read_pose(path)
            return ReadKey(applied(model, model.neutral(), pose), 0.0, pose.name, pose.tags)
        # Readers of all formats are not needed by the window's start.
        from faceposer.interchange.reading import pose_of_mesh

        mesh = read_mesh(path)
        coefficients = pose_of_mesh(mesh, model, str(path)).coefficients
        missed = displacements_of(mesh, path, model.character) - (
            model.instance(coefficients) - model.character.vertices
        )
        return ReadKey(coefficients, float(np.linalg.norm(missed, axis=1).max()))
    except FacePoserError as error:
        if str(path) in str(error):
            raise
        raise FacePoserError(f"The key '{path}' cannot be used: {error}") from error


def key_displacements(path: Path, character: Character) -> Array:
    """Return the displacements of the vertices of ``character`` in the mesh ``path``, shape (N, 3).

    Raises:
        FacePoserError: If the file cannot be read, has another topology, or numbers that are not finite.
    """
    return displacements_of(read_mesh(path), path, character)


def displacements_of(mesh: PolygonMesh, path: Path, character: Character) -> Array:
    """Return the displacements of the vertices of ``character`` in a ``mesh`` that was read from ``path``, (N, 3).

    Raises:
        FacePoserError: If it has another topology, or numbers that are not finite.
    """
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


def character_of(folder: KeyFolder, side: Side) -> tuple[Character, FaceModel | None]:
    """Return the character of one side of the keys in ``folder``, and its model; None for a mesh without shapes.

    Raises:
        FacePoserError: If it cannot be loaded.
    """
    if side == "target" and folder.is_mesh:
        return neutral_of(Path(folder.character("target"))), None
    model = load_side(folder, side)
    return model.character, model


def neutral_of(path: Path) -> Character:
    """Return the character without shapes whose neutral mesh is in ``path``.

    Raises:
        FacePoserError: If the file cannot be read, or its mesh cannot be a face; the message names it.
    """
    mesh = read_mesh(path)
    try:
        return character_of_mesh(mesh, path.stem)
    except FacePoserError as error:
        raise FacePoserError(f"'{path}' cannot be the target of key poses: {error}") from error


def load_side(folder: KeyFolder, side: Side) -> FaceModel:
    """Return the face model of a character with shapes in the keys of ``folder``.

    Raises:
        FacePoserError: If it cannot be loaded; the message names the description of the folder.
    """
    try:
        return load_model(folder.character(side))
    except FacePoserError as error:
        raise FacePoserError(f"'{folder.folder / DESCRIPTION}': {side}: {error}") from error
