"""Compositions of the emotional and verbal keys of a folder, on both characters."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.atomic import atomic_file, atomic_files
from faceposer.files.reading import open_text
from faceposer.files.writing import check_finite
from faceposer.geometry.mesh_io import POSED_MESH_SUFFIXES
from faceposer.geometry.obj_io import ObjWriter
from faceposer.model.character import Character
from faceposer.poses.applying import applied, pose_of
from faceposer.poses.pose_file import LONGEST_NAME, pose_text, read_pose
from faceposer.progress import Progress
from faceposer.session.key_entries import KeyFiles, count_with_neutral, delete_keys
from faceposer.session.key_files import character_of, key_displacements
from faceposer.session.key_folder import COMPOSED, EXPRESSION, SIDES, VISEME, KeyFolder, Side
from faceposer.session.key_kinds import check_kinds
from faceposer.transfer.examples import MOST_KEYS
from faceposer.transfer.key_models import Importance, Meeting, composed, importance, smoothed
from faceposer.transfer.keyed_model import check_size

Array = NDArray[np.float64]
# First line of a composed mesh. Programs that change the mesh write their own.
_COMMENT = "Composed by Face Poser"


@dataclass(frozen=True)
class Composition:
    """Report of a composition.

    Attributes:
        expressions: Number of emotional keys.
        visemes: Number of verbal keys.
        composed: Number of their combinations that were written.
        keys: Number of all keys, the neutral face included.
        kept: Number of combinations that the artist has changed, which stay as they are.
    """

    expressions: int
    visemes: int
    composed: int
    keys: int
    kept: int = 0


class _Face:
    """One side of the keys: its neutral mesh, and the displacements of its keys."""

    def __init__(self, folder: KeyFolder, side: Side, entries: list[KeyFiles], total: int = 0) -> None:
        """Read the keys ``entries``; of a mesh without shapes, ``total`` keys have to fit into memory later."""
        self.character, self.model = character_of(folder, side)
        self.height = self.character.height
        self.side = side
        check_size(len(entries) if self.model is not None else max(len(entries), total), len(self.character.vertices))
        self.moved = {entry.name: self._displacements(entry) for entry in entries}
        self._inverse: Array | None = None
        self._writer: ObjWriter | None = None

    @property
    def suffix(self) -> str:
        """Suffix of composed keys."""
        return ".json" if self.model is not None else ".obj"

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

    def text(self, path: Path, title: str, moved: Array) -> str:
        """Return the content of a composed key: the nearest pose of the shapes, or the mesh."""
        if self.model is not None:
            basis = self.model.basis
            if self._inverse is None:
                self._inverse = np.linalg.pinv((basis @ basis.T).astype(np.float64), rcond=1e-10, hermitian=True)
            nearest = self._inverse @ (basis @ moved.astype(np.float32).ravel()).astype(np.float64)
            return pose_text(path, pose_of(self.model, nearest, title, (COMPOSED,)))
        origin = self.character.origin
        assert origin is not None
        self._writer = self._writer or ObjWriter(origin.polygons, groups=origin.groups, comment=_COMMENT)
        vertices = origin.vertices_of(moved)
        check_finite(path, "mesh", vertices)
        return self._writer.text(vertices)


def compose_keys(folder: KeyFolder, meeting: Meeting = "smooth", progress: Progress | None = None) -> Composition:
    """Write the combination of each emotional with each verbal key, on both characters.

    Combinations become the nearest poses of a character's shapes, or meshes of a character without shapes. Earlier ones
    are replaced, unless the artist has changed one of their sides. If that fails or is cancelled, nothing has changed.

    Args:
        folder: The folder.
        meeting: Rule where both kinds of keys meet.
        progress: Receives the progress.

    Raises:
        FacePoserError: If there are no keys of a kind, or too many combinations, or a file cannot be used.
    """
    progress = progress or Progress()
    check_kinds(folder)
    kinds = folder.kinds()
    listed = {entry.name: entry for entry in folder.pairs()}
    entries = [entry for entry in listed.values() if kinds.get(entry.name) in (EXPRESSION, VISEME)]
    expressions = [entry.name for entry in entries if kinds[entry.name] == EXPRESSION]
    visemes = [entry.name for entry in entries if kinds[entry.name] == VISEME]
    pairs = {f"{expression}+{viseme}": (expression, viseme) for expression in expressions for viseme in visemes}
    made = [entry for entry in listed.values() if _is_as_composed(entry)]
    others = listed.keys() - {entry.name for entry in made}
    written = {name: pair for name, pair in pairs.items() if name not in others}
    total = count_with_neutral([*others, *written])
    if total > MOST_KEYS:
        raise FacePoserError(
            f"{len(expressions)} emotional and {len(visemes)} verbal keys have {len(pairs)} combinations, more than "
            f"the maximum of {MOST_KEYS} keys; remove some."
        )
    faces = [_Face(folder, side, entries, total) for side in SIDES]
    alphas = {face.side: face.importance(visemes, expressions).values for face in faces}
    if meeting == "smooth":
        alphas = {face.side: smoothed(alphas[face.side], face.character.triangles) for face in faces}
    places = {
        (face.side, name): folder.place(listed.get(name), name, face.side, face.suffix)
        for face in faces
        for name in written
    }
    titles = {entry.name: _title(entry) for entry in entries}
    _write(faces, alphas, written, titles, places, meeting, progress)
    delete_keys(path for entry in made for path in (entry.source, entry.target) if path and path not in places.values())
    return Composition(len(expressions), len(visemes), len(written), total, len(pairs) - len(written))


def _write(
    faces: list[_Face],
    alphas: Mapping[Side, Array],
    pairs: Mapping[str, tuple[str, str]],
    titles: Mapping[str, str],
    places: Mapping[tuple[Side, str], Path],
    meeting: Meeting,
    progress: Progress,
) -> None:
    """Write the combinations ``pairs`` of an emotional and a verbal key, by name, on both faces, all or none.

    Args:
        faces: The faces with the keys.
        alphas: Importance of the vertices of each face.
        pairs: Names of both keys of each combination.
        titles: Names of the keys for the user.
        places: File of each side of each combination.
        meeting: Rule where both kinds of keys meet.
        progress: Receives the progress.
    """
    files = [(face, name, places[face.side, name]) for face in faces for name in pairs]
    if not files:
        return
    # Compositions can be made again: hundreds of files need not be flushed one by one.
    with atomic_files([path for _, _, path in files], "key", durable=False) as temporaries:
        for done, ((face, name, path), temporary) in enumerate(zip(files, temporaries, strict=True)):
            progress.check()
            expression, viseme = pairs[name]
            moved = composed(face.moved[expression], face.moved[viseme], alphas[face.side], meeting, face.height)
            title = f"{titles[expression]} + {titles[viseme]}"[:LONGEST_NAME]
            temporary.write_text(face.text(path, title, moved), encoding="utf-8", newline="\n")
            progress.at("Composing keys", (done + 1) / len(files))


def _is_as_composed(entry: KeyFiles) -> bool:
    """Return True if both sides of a key are as they were composed; files that the artist renamed are not."""
    return "+" in entry.name and all(path and _has_mark(path) for path in (entry.source, entry.target))


def _has_mark(path: Path) -> bool:
    if path.suffix.lower() == ".json":
        return COMPOSED in read_pose(path).tags
    try:
        with open_text(path, errors="replace") as file:
            return file.readline(len(_COMMENT) + 8).strip("# \n") == _COMMENT
    except OSError:
        return False


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
