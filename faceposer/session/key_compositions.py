"""Compositions of the emotional and verbal keys of a folder, on both characters."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.atomic import atomic_file
from faceposer.geometry.mesh_io import POSED_MESH_SUFFIXES, read_mesh
from faceposer.geometry.obj_io import ObjWriter
from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel
from faceposer.poses.applying import applied, pose_of
from faceposer.poses.pose_file import LONGEST_NAME, read_pose, write_pose
from faceposer.progress import Progress
from faceposer.session.key_folder import COMPOSED, EXPRESSION, VISEME, KeyFiles, KeyFolder, Side
from faceposer.session.keys import key_displacements
from faceposer.session.opening import load_model
from faceposer.transfer.examples import MOST_KEYS
from faceposer.transfer.key_models import Importance, Meeting, composed, importance, smoothed
from faceposer.transfer.keyed_model import character_of_mesh

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Composition:
    """Report of a composition.

    Attributes:
        expressions: Number of emotional keys.
        visemes: Number of verbal keys.
        composed: Number of their combinations.
        keys: Number of all keys, the neutral face included.
    """

    expressions: int
    visemes: int
    composed: int
    keys: int


class _Face:
    """One side of the keys: its neutral mesh, and the displacements of its keys."""

    def __init__(self, folder: KeyFolder, side: Side, entries: list[KeyFiles]) -> None:
        self.model: FaceModel | None = None
        if side == "target" and folder.is_mesh:
            path = Path(folder.character("target"))
            self.character: Character = character_of_mesh(read_mesh(path), path.stem)
        else:
            self.model = load_model(folder.character(side))
            self.character = self.model.character
        self.height = self.character.height
        self.side = side
        self._folder = folder.folder / side
        self.moved = {entry.name: self._displacements(entry) for entry in entries}

    def _displacements(self, entry: KeyFiles) -> NDArray[np.float32]:
        path = entry.source if self.side == "source" else entry.target
        assert path is not None
        if path.suffix.lower() in POSED_MESH_SUFFIXES:
            return key_displacements(path, self.character).astype(np.float32)
        if self.model is None:
            raise FacePoserError(
                f"The key '{path}' is a pose, but the target is a mesh without shapes; give a mesh (.obj)."
            )
        pose = applied(self.model, self.model.neutral(), read_pose(path))
        return self.model.instance(pose) - self.character.vertices

    def importance(self, visemes: list[str], expressions: list[str]) -> Importance:
        return importance(
            self.character.vertices,
            [self.moved[name] for name in visemes],
            [self.moved[name] for name in expressions],
            self.height,
        )

    def write(self, name: str, title: str, moved: Array, inverse: Array | None) -> None:
        """Write a composed key as the nearest pose of the shapes, or as a mesh."""
        if self.model is not None and inverse is not None:
            flat = self.model.basis @ moved.astype(np.float32).ravel()
            pose = pose_of(self.model, inverse @ flat.astype(np.float64), title, (COMPOSED,))
            # Compositions can be made again: hundreds of files need not be flushed one by one.
            write_pose(self._folder / f"{name}.json", pose, durable=False)
            return
        origin = self.character.origin
        assert origin is not None
        writer = ObjWriter(origin.polygons, groups=origin.groups)
        writer.write(self._folder / f"{name}.obj", origin.vertices_of(moved))


def compose_keys(folder: KeyFolder, meeting: Meeting = "smooth", progress: Progress | None = None) -> Composition:
    """Write the combination of each emotional with each verbal key, on both characters.

    Combinations become the nearest poses of a character's shapes, or meshes of a character without shapes; earlier
    ones are replaced.

    Args:
        folder: The folder.
        meeting: Rule where both kinds of keys meet.
        progress: Receives the progress.

    Raises:
        FacePoserError: If there are no keys of a kind, or too many combinations, or a file cannot be used.
    """
    progress = progress or Progress()
    kinds = folder.kinds()
    entries = [entry for entry in folder.pairs() if kinds.get(entry.name) in (EXPRESSION, VISEME)]
    others = [name for name in (entry.name for entry in folder.entries()) if kinds.get(name) != COMPOSED]
    expressions = [entry.name for entry in entries if kinds[entry.name] == EXPRESSION]
    visemes = [entry.name for entry in entries if kinds[entry.name] == VISEME]
    total = len(expressions) * len(visemes)
    if len(others) + total >= MOST_KEYS:
        raise FacePoserError(
            f"{len(expressions)} emotional and {len(visemes)} verbal keys have {total} combinations, more than "
            f"the maximum of {MOST_KEYS} keys; remove some."
        )
    earlier = [name for name, kind in kinds.items() if kind == COMPOSED]
    try:
        _compose(folder, (expressions, visemes), entries, earlier, meeting, progress)
    except BaseException:
        # Combinations of one side only would make all keys unusable.
        names = {f"{expression}+{viseme}" for expression in expressions for viseme in visemes}
        for entry in folder.entries():
            if entry.name in names and None in (entry.source, entry.target):
                folder.remove(entry.name)
        raise
    base = not any(name.casefold() == "neutral" for name in others)
    return Composition(len(expressions), len(visemes), total, len(others) + total + base)


def _compose(
    folder: KeyFolder,
    names: tuple[list[str], list[str]],
    entries: list[KeyFiles],
    earlier: list[str],
    meeting: Meeting,
    progress: Progress,
) -> None:
    """Write the combinations of the emotional and verbal keys ``names`` on both sides, in place of ``earlier`` ones."""
    expressions, visemes = names
    titles = {entry.name: _title(entry) for entry in entries}
    done, total = 0, len(expressions) * len(visemes)
    for side in ("source", "target"):
        face = _Face(folder, side, entries)
        alpha = face.importance(visemes, expressions).values
        if meeting == "smooth":
            alpha = smoothed(alpha, face.character.triangles)
        inverse = None
        if face.model is not None:
            basis = face.model.basis
            inverse = np.linalg.pinv((basis @ basis.T).astype(np.float64), rcond=1e-10, hermitian=True)
        if side == "source":
            for name in earlier:
                folder.remove(name)
        for expression in expressions:
            for viseme in visemes:
                progress.check()
                moved = composed(face.moved[expression], face.moved[viseme], alpha, meeting, face.height)
                title = f"{titles[expression]} + {titles[viseme]}"[:LONGEST_NAME]
                face.write(f"{expression}+{viseme}", title, moved, inverse)
                done += 1
                progress.at("Composing keys", done / (2 * total))


def _title(entry: KeyFiles) -> str:
    """Return the title of a key: the name of the source's pose, or of the files of a mesh."""
    path = entry.source
    return read_pose(path).name if path is not None and path.suffix.lower() == ".json" else entry.name


def folder_importance(folder: KeyFolder, side: Side) -> tuple[Importance, Character]:
    """Return the importance of the vertices of a character for speech, by the keys of the folder, and the character.

    Raises:
        FacePoserError: If there are no keys of a kind, or a file cannot be used.
    """
    kinds = folder.kinds()
    entries = [entry for entry in folder.pairs() if kinds.get(entry.name) in (EXPRESSION, VISEME)]
    face = _Face(folder, side, entries)
    names = {kind: [entry.name for entry in entries if kinds[entry.name] == kind] for kind in (EXPRESSION, VISEME)}
    return face.importance(names[VISEME], names[EXPRESSION]), face.character


def write_importance(folder: KeyFolder, side: Side, path: Path) -> None:
    """Write the importance of a character's vertices as arrays (.npz) or as a picture (.png).

    The picture has the verbal, the emotional and the combined importance side by side; brighter vertices are more
    important for speech, or for emotions in the second.

    Raises:
        FacePoserError: If there are no keys of a kind, or a file cannot be used or written.
    """
    found, character = folder_importance(folder, side)
    if path.suffix.lower() == ".npz":
        with atomic_file(path, "importance") as temporary, temporary.open("wb") as file:
            np.savez_compressed(
                file,
                verbal=found.verbal,
                emotional=found.emotional,
                verbal_spread=found.verbal_spread,
                emotional_spread=found.emotional_spread,
                values=found.values,
            )
        return
    write_picture(path, importance_picture(character, [found.verbal_spread, found.emotional_spread, found.values]))


def importance_picture(character: Character, values: list[Array], size: int = 480) -> NDArray[np.uint8]:
    """Return the face of ``character`` with each of the ``values``, (N,) from 0 to 1, as brightness, side by side."""
    from faceposer.landmarks.drawing import draw
    from faceposer.landmarks.painting import painted_character
    from faceposer.model.framing import face_view

    bare = replace(character, textures={})
    camera = face_view(character).camera((size, size))
    pictures = []
    for value in values:
        mesh = painted_character(bare)
        # From dark blue over grey to light yellow, which prints in grey, too.
        low, high = np.array([35.0, 40.0, 75.0]), np.array([255.0, 240.0, 190.0])
        mesh = replace(mesh, colours=low + np.clip(value, 0.0, 1.0)[:, None] * (high - low))
        pictures.append(draw(mesh, camera).image)
    return np.concatenate(pictures, axis=1)


def write_picture(path: Path, picture: NDArray[np.uint8]) -> None:
    """Write ``picture``, shape (h, w, 3), as PNG to ``path``.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    from faceposer.render.images import write_png

    write_png(path, picture)
