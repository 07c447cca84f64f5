"""The posed face as meshes that other programs read: OBJ with materials, and PLY, one file or a folder of them.

A character from a file of its own goes back in the unit, the axes and the order of that file.
"""

from collections.abc import Callable, Generator
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.files import paths
from faceposer.files.atomic import atomic_files, atomic_folder
from faceposer.files.reading import open_file
from faceposer.geometry.mesh import VertexNormals
from faceposer.geometry.obj_io import ObjWriter
from faceposer.geometry.ply_io import write_ply
from faceposer.interchange.obj_materials import holds, library_files, library_name, materials_of
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.progress import Progress

SequenceKind = Literal["obj", "ply"]

# How the library of an OBJ file begins.
_SIGNATURE = b"# Face Poser"
_WriteFrame = Callable[[Path, NDArray[np.floating]], None]


def write_posed_obj(
    path: Path, model: FaceModel, coefficients: ArrayLike, contact: bool = True, materials: bool = True
) -> None:
    """Write the face with ``coefficients``, shape (r,), as OBJ, with the faces, UVs and groups that the character has.

    Materials go into a library beside it, smile.mtl for smile.obj, which is replaced like the OBJ file, and textures
    into pictures such as smile_skin.jpg, which replace no other picture. All files are written, or none.

    Args:
        path: The file.
        model: The face.
        coefficients: Shape (r,).
        contact: Write it after the contact step, as the window shows it.
        materials: Write the library and the textures too.

    Raises:
        FacePoserError: If a file cannot be written.
    """
    files = _library(path.parent, path.stem, model) if materials else {}
    content = _obj_frames(model, library_name(path.stem) if files else "")(model.surface(coefficients, contact))
    changed = {
        path.with_name(name): data for name, data in files.items() if holds(path.with_name(name), data) is not True
    }
    with atomic_files([*changed, path], "mesh") as temporaries:
        for temporary, data in zip(temporaries, [*changed.values(), content], strict=True):
            temporary.write_bytes(data)


def foreign_library(path: Path) -> tuple[Path, ...]:
    """Return the material library beside ``path`` that ``write_posed_obj`` would replace, if we did not write it."""
    library = path.with_name(library_name(path.stem))
    try:
        with open_file(library) as file:
            ours = file.read(len(_SIGNATURE)) == _SIGNATURE
    except OSError:
        ours = not paths.exists(library)
    return () if ours else (library,)


def write_posed_ply(path: Path, model: FaceModel, coefficients: ArrayLike, contact: bool = True) -> None:
    """Write the face with ``coefficients``, shape (r,), as binary PLY with normals and the faces of the character.

    With ``contact`` it is written after the contact step, as the window shows it.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    _ply_frames(model)(path, model.surface(coefficients, contact))


def write_sequence(
    folder: Path,
    model: FaceModel,
    performance: Performance,
    kind: SequenceKind = "obj",
    progress: Progress | None = None,
    contact: bool = True,
    materials: bool = True,
) -> list[Path]:
    """Write every frame of ``performance`` as a mesh of its own, as ``sequence_steps`` does, and return the meshes.

    Raises:
        FacePoserError: If the folder holds something or cannot be written.
    """
    for share in sequence_steps(folder, model, performance, kind, contact, materials):
        (progress or Progress()).at("Writing", share)
    return sorted(folder.glob(f"*.{kind}"))


def sequence_steps(
    folder: Path,
    model: FaceModel,
    performance: Performance,
    kind: SequenceKind = "obj",
    contact: bool = True,
    materials: bool = True,
) -> Generator[float, None, None]:
    """Write every frame of ``performance`` as a mesh of its own into ``folder``, which must be new or empty.

    The files are called by the folder and the number of the frame, from 1, such as smile.0001.obj; after each, the
    share that is done is told. The folder appears when all are written; if the iterator is closed before, not at all.
    With ``contact`` the meshes are written after the contact step, and with ``materials`` all OBJ files share one
    library, smile.mtl, and its textures.

    Raises:
        FacePoserError: If the folder holds something or cannot be written.
    """
    files = _library(folder, folder.name, model) if materials and kind == "obj" else {}
    write = _ply_frames(model) if kind == "ply" else _obj_files(model, library_name(folder.name) if files else "")
    digits = max(4, len(str(len(performance))))
    with atomic_folder(folder) as temporary:
        for name, data in files.items():
            (temporary / name).write_bytes(data)
        for number, pose in enumerate(performance.coefficients, 1):
            write(temporary / f"{folder.name}.{number:0{digits}}.{kind}", model.surface(pose, contact))
            yield number / len(performance)


def _library(folder: Path, stem: str, model: FaceModel) -> dict[str, bytes]:
    """Return the files of the material library ``stem`` for ``folder``; none if the character has no materials."""
    looks = materials_of(model.character)
    return library_files(folder, stem, looks, _comment(model)) if looks.materials else {}


def _obj_files(model: FaceModel, library: str) -> _WriteFrame:
    """Return what writes the character's vertices, (N, 3), into an OBJ file of the folder of a sequence."""
    content = _obj_frames(model, library)

    def write(path: Path, vertices: NDArray[np.floating]) -> None:
        path.write_bytes(content(vertices))

    return write


def _obj_frames(model: FaceModel, library: str) -> Callable[[NDArray[np.floating]], bytes]:
    """Return what gives the content of an OBJ file with the character's vertices, (N, 3), and the library's name."""
    character = model.character
    origin = character.origin
    normals = VertexNormals(character.triangles, len(character.vertices))
    groups, comment = materials_of(character).groups, _comment(model)
    if origin is None:
        whole = ObjWriter(character.polygons, character.uv, character.polygon_uvs, True, groups, comment, library)
        return lambda vertices: whole.text(vertices, normals(vertices)).encode(errors="replace")
    has_uvs = len(origin.polygon_uvs) > 0
    uv, polygon_uvs = (origin.uv, origin.polygon_uvs) if has_uvs else (None, None)
    writer = ObjWriter(origin.polygons, uv, polygon_uvs, True, groups, comment, library)
    return lambda vertices: writer.text(
        origin.vertices_of(vertices - character.vertices), origin.normals_of(normals(vertices))
    ).encode(errors="replace")


def _ply_frames(model: FaceModel) -> _WriteFrame:
    """Return what writes the character's vertices, (N, 3), as PLY."""
    character, comment = model.character, _comment(model)
    origin = character.origin
    normals = VertexNormals(character.triangles, len(character.vertices))
    if origin is None:
        return lambda path, vertices: write_ply(path, vertices, character.polygons, normals(vertices), comment)
    return lambda path, vertices: write_ply(
        path,
        origin.vertices_of(vertices - character.vertices),
        origin.polygons,
        origin.normals_of(normals(vertices)),
        comment,
    )


def _comment(model: FaceModel) -> str:
    return " ".join(f"Face Poser: {model.character.title}. {model.character.credits}".split())
