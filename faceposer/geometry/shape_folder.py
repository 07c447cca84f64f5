"""Reading of shape folders: a file for the neutral face and one for each shape, all of the same topology."""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.files import paths
from faceposer.files.names import displayable, is_hidden
from faceposer.geometry.displacement_fields import edges_of
from faceposer.geometry.mesh_io import read_mesh
from faceposer.geometry.mtl_io import read_obj_textures
from faceposer.geometry.polygon_mesh import MorphMesh, PolygonMesh
from faceposer.geometry.shape_alignment import (
    Alignment,
    AlignmentReport,
    implausible,
    implausible_size,
    in_another_unit,
    lay_on,
    search_tree,
)

SHAPE_SUFFIXES = (".obj", ".ply", ".stl", ".off")
NEUTRAL_NAMES = ("neutral", "base", "basis", "rest", "generic_neutral_mesh")
_MAX_OFFSET_BYTES = 2 << 30


def read_shape_folder(folder: Path, neutral: Path | None = None, align: bool = True) -> MorphMesh:
    """Read the meshes in ``folder`` as offsets from the neutral face.

    Shapes are named by their files, without a common prefix. Faces, texture coordinates and groups are those of the
    neutral face.

    Args:
        folder: Folder of OBJ, PLY, STL or OFF files with the same vertices in the same order.
        neutral: File of the neutral face, in the folder or elsewhere; found by its name if None.
        align: False to read shapes where they are stored.

    Raises:
        FacePoserError: If no neutral face is found, two shapes have the same name, or a file cannot be read or has a
            different topology.
    """
    try:
        files = sorted(
            path
            for path in folder.iterdir()
            if path.suffix.lower() in SHAPE_SUFFIXES and not is_hidden(path) and paths.is_file(path)
        )
    except OSError as error:
        raise FacePoserError(f"The folder '{folder}' cannot be read: {error.strerror}.") from error
    if neutral is None:
        neutral = _find_neutral(folder, files)
    elif not paths.is_file(neutral) and paths.is_file(folder / neutral):
        neutral = folder / neutral
    rest = read_mesh(neutral)
    shapes = [path for path in files if not paths.same_file(path, neutral)]
    size = len(shapes) * rest.vertices.size * 4
    if size > _MAX_OFFSET_BYTES:
        raise FacePoserError(
            f"The folder '{folder}' has {counted(len(shapes), 'shape')} of "
            f"{counted(len(rest.vertices), 'vertex', 'vertices')}, which would take "
            f"{size >> 20} MB; choose a folder that takes less than {_MAX_OFFSET_BYTES >> 20} MB."
        )
    names, unusable = _shape_names(shapes, neutral)
    targets = {}
    reordered: list[str] = []
    report = AlignmentReport()
    tree, edges = search_tree(rest.vertices), edges_of(rest.polygons, rest.vertices)
    extent = float(np.ptp(rest.vertices, axis=0).max())
    oversized: dict[str, str] = {}
    for name, path in names.items():
        positions, is_reordered = _positions(path, rest, neutral)
        reordered += [name] if is_reordered else []
        aligned = lay_on(positions, rest.vertices) if align else Alignment(positions)
        report.add(name, aligned.change)
        reason = implausible(aligned.vertices, rest.vertices, tree, edges, sized=False)
        offsets = aligned.vertices - rest.vertices
        too_large = "" if reason else implausible_size(np.linalg.norm(offsets, axis=1), extent)
        if reason or too_large:
            (unusable if reason else oversized)[name] = (
                f"The shape '{path}' is not an expression of the neutral face '{neutral}': {reason or too_large}; "
                "export all shapes in the unit of the neutral face, with the same vertices in the same order."
            )
        with np.errstate(over="ignore"):
            targets[name] = offsets.astype(np.float32)
    if not (align and in_another_unit([*targets.values()], rest.vertices)):
        unusable = {**oversized, **unusable}
    textures, notes = read_obj_textures(neutral, rest)
    if reordered:
        some = (
            f"{len(reordered)} shapes, such as '{reordered[0][:60]}', have their"
            if len(reordered) > 1
            else f"The shape '{reordered[0][:60]}' has its"
        )
        notes = (f"{some} vertices in another order than the neutral face; the faces gave the order.", *notes)
    return MorphMesh(rest, targets, textures, (*report.notes(), *notes), unusable)


def _find_neutral(folder: Path, files: list[Path]) -> Path:
    """Return the file with a name for the neutral face, else the one with a name that ends in or has such a word."""
    whole = [path for path in files if path.stem.lower() in NEUTRAL_NAMES]
    last = [path for path in files if _words(path.stem)[-1] in NEUTRAL_NAMES]
    found = whole or last
    if not found:
        # The name of the mesh may follow, as in neutral_Head_Mesh.
        inner = [path for path in files if not set(NEUTRAL_NAMES).isdisjoint(_words(path.stem))]
        found = inner if len(inner) == 1 else []
    if len(found) > 1:
        raise FacePoserError(
            f"In the folder '{folder}' both '{found[0].name}' and '{found[1].name}' may be the neutral face; rename "
            "one or specify the neutral face."
        )
    if not files:
        raise FacePoserError(
            f"The folder '{folder}' contains no meshes; add a mesh for each shape and one named neutral."
        )
    if not found:
        raise FacePoserError(
            f"The folder '{folder}' has no neutral face among its {counted(len(files), 'mesh', 'meshes')}; name it "
            f"{', '.join(NEUTRAL_NAMES[:-1])} or {NEUTRAL_NAMES[-1]} ({', '.join(SHAPE_SUFFIXES)}), or specify it."
        )
    return found[0]


def _words(stem: str) -> list[str]:
    return [word.lower() for word in re.split(r"[\W_]+|(?<=[a-z])(?=[A-Z])", stem)]


def _shape_names(shapes: list[Path], neutral: Path) -> tuple[dict[str, Path], dict[str, str]]:
    """Return the files by shape name: the file stem without the prefix, up to a separator, that all files share.

    Of several files with one name, the first is returned, with an error message by the name, for the case that the
    shape is used.
    """
    stems = [path.stem for path in (*shapes, neutral)]
    ends = [end.end() for end in re.finditer(r"[\W_]+", stems[0])]
    cut = max((end for end in ends if all(stem.startswith(stems[0][:end]) for stem in stems)), default=0)
    names: dict[str, Path] = {}
    unusable: dict[str, str] = {}
    for path in shapes:
        name = displayable(path.stem[cut:] or path.stem)
        if name in names:
            unusable[name] = (
                f"'{names[name]}' and '{path}' have the same shape name, {name}; remove or rename one of them."
            )
        else:
            names[name] = path
    return names, unusable


def _positions(path: Path, rest: PolygonMesh, neutral: Path) -> tuple[NDArray[np.float64], bool]:
    """Return the vertices of a shape in the order of the neutral face, and True if the file has another order."""
    mesh = read_mesh(path)
    remedy = "export all shapes with the same vertices in the same order"
    if len(mesh.vertices) != len(rest.vertices):
        raise FacePoserError(
            f"The shape '{path}' has {counted(len(mesh.vertices), 'vertex', 'vertices')}, but the neutral face "
            f"'{neutral}' has {len(rest.vertices)}; {remedy}."
        )
    difference = _first_difference(mesh, rest)
    order = _order_by_faces(mesh, rest) if difference else None
    if order is not None:
        return mesh.vertices[order], True
    if difference:
        raise FacePoserError(
            f"The faces of the shape '{path}' differ from the neutral face '{neutral}': {difference}; {remedy}."
        )
    return mesh.vertices, False


def _order_by_faces(mesh: PolygonMesh, rest: PolygonMesh) -> NDArray[np.intp] | None:
    """Return the vertex of ``mesh`` for each vertex of ``rest`` if their faces correspond in their order, else None."""
    if mesh.polygons.shape != rest.polygons.shape:
        return None
    order = np.full(len(rest.vertices) + 1, -1, dtype=np.intp)
    # Faces of fewer corners end in -1, which corresponds to itself.
    order[rest.polygons] = mesh.polygons
    is_same = bool((order[rest.polygons] == mesh.polygons).all()) and order[-1] == -1
    order = order[:-1]
    return order if is_same and (np.bincount(order[order >= 0], minlength=len(order)) == 1).all() else None


def _first_difference(mesh: PolygonMesh, rest: PolygonMesh) -> str:
    """Return a description of the first difference between the faces, empty if there is none."""
    if np.array_equal(mesh.polygons, rest.polygons):
        return ""
    a, b = mesh.polygons, rest.polygons
    if a.shape != b.shape:
        # Other formats may be triangulated, with an arbitrary first corner.
        a, b = mesh.triangles(), rest.triangles()
        if len(a) != len(b):
            return f"it has {counted(len(mesh.polygons), 'face')}, not {len(rest.polygons)}"
    differing = (_lowest_first(a) != _lowest_first(b)).any(axis=1)
    if not differing.any():
        return ""
    face = int(np.argmax(differing))
    corners = [", ".join(str(v + 1) for v in row[face].tolist() if v >= 0) for row in (a, b)]
    return f"face {face + 1} has the corners {corners[0]}, not {corners[1]}"


def _lowest_first(faces: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return triangles rotated so that the lowest vertex comes first; other faces unchanged."""
    if faces.shape[1] != 3:
        return faces
    turn = (np.arange(3) + np.argmin(faces, axis=1)[:, None]) % 3
    return np.take_along_axis(faces, turn, axis=1)
