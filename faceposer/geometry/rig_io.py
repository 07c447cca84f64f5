"""Reading of rigs, faces with shapes, from files and folders of any supported kind."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.geometry.displacement_fields import edges_of
from faceposer.geometry.gltf_io import GLTF_SUFFIXES, read_gltf
from faceposer.geometry.mesh import first_unusable
from faceposer.geometry.polygon_mesh import MorphMesh
from faceposer.geometry.shape_alignment import (
    Alignment,
    AlignmentReport,
    implausible,
    in_another_unit,
    lay_on,
    search_tree,
    still_share,
)
from faceposer.geometry.shape_folder import SHAPE_SUFFIXES, read_shape_folder


def read_rig(
    path: Path, neutral: Path | None = None, align: bool = True, weights_range: float | None = None
) -> MorphMesh:
    """Read the face with its shapes in ``path``.

    Args:
        path: A glTF file (.glb, .gltf, .vrm), or a folder with a mesh for each shape and one for the neutral face.
        neutral: File of the neutral face, for folders in which it cannot be identified by its name.
        align: False to read shapes as they are stored, without laying them on the neutral face.
        weights_range: Full weight of an avatar's expressions, 1 or 100; None to infer it.

    Raises:
        FacePoserError: If it cannot be read, is invalid, or has no shapes.
    """
    if not paths.exists(path):
        raise FacePoserError(f"The rig '{path}' does not exist; choose a folder of shapes or a glTF file.")
    if paths.is_dir(path):
        rig = read_shape_folder(path, neutral, align)
        kind = "folder"
        remedy = f"add a mesh for each shape to the folder ({', '.join(SHAPE_SUFFIXES)})"
    elif path.suffix.lower() in GLTF_SUFFIXES:
        if neutral is not None:
            raise FacePoserError(f"The rig '{path}' contains its neutral face; omit '{neutral}'.")
        rig = _plausible(read_gltf(path, weights_range), path, align)
        kind = "rig"
        remedy = "export it with its shape keys (blend shapes)"
    else:
        raise FacePoserError(
            f"'{path}' is not a supported rig; choose a folder with a mesh for each shape, or a file of type "
            f"{', '.join(GLTF_SUFFIXES)}."
        )
    if not len(rig.mesh.vertices) or not len(rig.mesh.polygons):
        raise FacePoserError(f"The {kind} '{path}' has no faces; choose one with a surface.")
    if not rig.targets:
        raise FacePoserError(f"The {kind} '{path}' has no shapes; {remedy}.")
    for name, offsets in rig.targets.items():
        if (row := first_unusable(offsets)) is not None:
            problem = "too large" if np.isfinite(offsets[row]).all() else "not finite"
            raise FacePoserError(
                f"The shape '{name}' of the {kind} '{path}' is {problem} at vertex {row + 1}; export it again."
            )
    return rig


def _plausible(rig: MorphMesh, path: Path, align: bool) -> MorphMesh:
    """Return the ``rig`` of a glTF file with its displacements corrected where they are none, if ``align``.

    Some exporters store the positions of a target instead of its displacements, or displacements from another mesh.
    """
    report = AlignmentReport()
    neutral = rig.mesh.vertices
    tree, edges = search_tree(neutral), edges_of(rig.mesh.polygons, neutral)
    # Displacements of a whole rig in another unit are converted by its size as a face.
    whole = align and in_another_unit([*rig.targets.values()], neutral)
    targets = dict(rig.targets)
    unusable = dict(rig.unusable)
    absolute = []
    for name, offsets in rig.targets.items():
        vertices = neutral + offsets
        if not (np.isfinite(vertices).all() and offsets.any()):
            continue
        as_positions = offsets.astype(np.float64)
        if align and still_share(as_positions, neutral) > 0.5 > still_share(vertices, neutral):
            absolute.append(name)
            vertices = as_positions
        aligned = lay_on(vertices, neutral) if align else Alignment(vertices)
        report.add(name, aligned.change)
        reason = implausible(aligned.vertices, neutral, tree, edges, sized=not whole)
        if reason:
            unusable[name] = (
                f"The target '{name[:60]}' of the rig '{path}' is not an expression of its face: {reason}; export it "
                "again."
            )
        if aligned.change or name in absolute:
            targets[name] = (aligned.vertices - neutral).astype(np.float32)
    notes = report.notes()
    if absolute:
        some = (
            f"{len(absolute)} targets, such as '{absolute[0][:60]}', have"
            if len(absolute) > 1
            else f"The target '{absolute[0][:60]}' has"
        )
        notes += (f"{some} positions instead of displacements; the neutral face was subtracted.",)
    return replace(rig, targets=targets, notes=(*rig.notes, *notes), unusable=unusable)


def empty_targets(rig: MorphMesh) -> tuple[str, ...]:
    """Return the names of the shapes that do not move any vertex."""
    return tuple(name for name, offsets in rig.targets.items() if not offsets.any())
