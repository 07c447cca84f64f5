"""Export of posed meshes: OBJ with materials, and PLY, as one file or a sequence of files.

An imported character is written in the unit, axes and vertex order of its original file.
"""

from collections.abc import Callable, Generator
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.files import paths
from faceposer.files.atomic import atomic_files, atomic_folder
from faceposer.files.reading import open_file
from faceposer.files.writing import check_finite
from faceposer.geometry.mesh import VertexNormals
from faceposer.geometry.obj_io import ObjWriter
from faceposer.geometry.ply_io import write_ply
from faceposer.interchange.obj_materials import has_content, library_files, library_name, materials_of
from faceposer.interchange.surfaces import check_textures
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.progress import Progress

SequenceKind = Literal["obj", "ply"]

# First bytes of a material library written by this program.
_SIGNATURE = b"# Face Poser"
# Remedy for textures that cannot be written.
_WITHOUT = ", or leave out the materials"
_WriteFrame = Callable[[Path, NDArray[np.floating]], None]


def write_posed_obj(
    path: Path, model: FaceModel, coefficients: ArrayLike, contact: bool = True, materials: bool = True
) -> None:
    """Write a posed face as OBJ, with the polygons, UVs and groups of the character.

    Materials are written to a library next to it, smile.mtl for smile.obj, which is replaced like the OBJ file, and
    textures to images such as smile_skin.jpg, which replace no other image. Either all files are written or none.

    Args:
        path: The file.
        model: The face.
        coefficients: The pose, shape (r,).
        contact: Include the contact step, as the window shows it.
        materials: Write the material library and the textures.

    Raises:
        FacePoserError: If a file cannot be written.
    """
    if materials:
        check_textures(path, "mesh", model.character, _WITHOUT)
    files = _library(path.parent, path.stem, model) if materials else {}
    check_finite(path, "mesh", coefficients)
    encoded = _obj_encoder(model, library_name(path.stem) if files else "")
    content = encoded(path, model.surface(coefficients, contact))
    changed = {
        path.with_name(name): data
        for name, data in files.items()
        if has_content(path.with_name(name), data) is not True
    }
    with atomic_files([*changed, path], "mesh") as temporaries:
        for temporary, data in zip(temporaries, [*changed.values(), content], strict=True):
            temporary.write_bytes(data)


def foreign_library(path: Path) -> tuple[Path, ...]:
    """Return the material library next to ``path`` that ``write_posed_obj`` would replace, if of another program."""
    library = path.with_name(library_name(path.stem))
    try:
        with open_file(library) as file:
            is_foreign = file.read(len(_SIGNATURE)) != _SIGNATURE
    except OSError:
        is_foreign = paths.exists(library)
    return (library,) if is_foreign else ()


def write_posed_ply(path: Path, model: FaceModel, coefficients: ArrayLike, contact: bool = True) -> None:
    """Write a posed face as binary PLY, with normals and the polygons of the character.

    Args:
        path: The file.
        model: The face.
        coefficients: The pose, shape (r,).
        contact: Include the contact step, as the window shows it.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    check_finite(path, "mesh", coefficients)
    _ply_writer(model)(path, model.surface(coefficients, contact))


def write_sequence(
    folder: Path,
    model: FaceModel,
    performance: Performance,
    kind: SequenceKind = "obj",
    progress: Progress | None = None,
    contact: bool = True,
    materials: bool = True,
) -> list[Path]:
    """Write every frame of ``performance`` as a mesh, as ``sequence_steps`` does, and return the paths of the meshes.

    Raises:
        FacePoserError: If the folder is not empty or cannot be written.
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
    """Write every frame of ``performance`` as a mesh, yielding the completed share after each.

    The files are named by the folder and the frame number, from 1, such as smile.0001.obj. The folder appears once all
    files are written, and not at all if the iterator is closed early.

    Args:
        folder: New or empty folder.
        model: The face.
        performance: Its poses.
        kind: "obj" or "ply".
        contact: Include the contact step, as the window shows it.
        materials: Write one material library, such as smile.mtl, and its textures for all OBJ files.

    Raises:
        FacePoserError: If the folder is not empty or cannot be written.
    """
    check_finite(folder, "folder", performance.coefficients)
    if materials and kind == "obj":
        check_textures(folder, "folder", model.character, _WITHOUT)
    files = _library(folder, folder.name, model) if materials and kind == "obj" else {}
    write = _ply_writer(model) if kind == "ply" else _obj_writer(model, library_name(folder.name) if files else "")
    digits = max(4, len(str(len(performance))))
    with atomic_folder(folder) as temporary:
        for name, data in files.items():
            (temporary / name).write_bytes(data)
        for number, pose in enumerate(performance.coefficients, 1):
            write(temporary / f"{folder.name}.{number:0{digits}}.{kind}", model.surface(pose, contact))
            yield number / len(performance)


def _library(folder: Path, stem: str, model: FaceModel) -> dict[str, bytes]:
    """Return the files of the material library ``stem`` for ``folder``; none if the character has no materials."""
    materials = materials_of(model.character)
    return library_files(folder, stem, materials, _comment(model)) if materials.materials else {}


def _obj_writer(model: FaceModel, library: str) -> _WriteFrame:
    """Return the function that writes the character's vertices, shape (N, 3), to an OBJ file of a sequence."""
    content = _obj_encoder(model, library)

    def write(path: Path, vertices: NDArray[np.floating]) -> None:
        path.write_bytes(content(path, vertices))

    return write


def _obj_encoder(model: FaceModel, library: str) -> Callable[[Path, NDArray[np.floating]], bytes]:
    """Return the function from vertices, shape (N, 3), to the content of an OBJ file that refers to ``library``.

    The path of the file is for messages.
    """
    character = model.character
    origin = character.origin
    normals = VertexNormals(character.triangles, len(character.vertices))
    groups, comment = materials_of(character).groups, _comment(model)
    if origin is None:
        writer = ObjWriter(character.polygons, character.uv, character.polygon_uvs, True, groups, comment, library)
    else:
        uv, polygon_uvs = (origin.uv, origin.polygon_uvs) if len(origin.polygon_uvs) > 0 else (None, None)
        writer = ObjWriter(origin.polygons, uv, polygon_uvs, True, groups, comment, library)

    def encoded(path: Path, vertices: NDArray[np.floating]) -> bytes:
        points: NDArray[np.floating] = vertices
        directions: NDArray[np.floating] = normals(vertices)
        if origin is not None:
            points, directions = origin.vertices_of(points - character.vertices), origin.normals_of(directions)
        check_finite(path, "mesh", points, directions)
        return writer.text(points, directions).encode(errors="replace")

    return encoded


def _ply_writer(model: FaceModel) -> _WriteFrame:
    """Return the function that writes the character's vertices, shape (N, 3), to a PLY file."""
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
