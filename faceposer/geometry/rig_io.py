"""Reading a face with its shapes from any kind of file or folder."""

from pathlib import Path

import numpy as np

from faceposer.errors import FacePoserError
from faceposer.geometry.gltf_io import GLTF_SUFFIXES, read_gltf
from faceposer.geometry.polygon_mesh import MorphMesh
from faceposer.geometry.shape_folder import SHAPE_SUFFIXES, read_shape_folder


def read_rig(path: Path, neutral: Path | None = None) -> MorphMesh:
    """Return the face with its shapes in ``path``.

    Args:
        path: A glTF file (.glb, .gltf, .vrm), or a folder with a mesh for each shape and one for the neutral.
        neutral: The neutral's file, for a folder where its name does not tell.

    Raises:
        FacePoserError: If it cannot be read, is broken, or has no shapes, naming the place.
    """
    if not path.exists():
        raise FacePoserError(f"The rig '{path}' does not exist; give a folder of shapes or a glTF file.")
    if path.is_dir():
        rig = read_shape_folder(path, neutral)
        kind = "folder"
        remedy = f"put a mesh for each shape beside the neutral ({', '.join(SHAPE_SUFFIXES)})"
    elif path.suffix.lower() in GLTF_SUFFIXES:
        if neutral is not None:
            raise FacePoserError(f"The rig '{path}' has its own neutral face; leave out '{neutral}'.")
        rig = read_gltf(path)
        kind = "rig"
        remedy = "export it with its shape keys (blend shapes)"
    else:
        raise FacePoserError(
            f"'{path}' is no rig that can be read; give a folder with a mesh for each shape, or one of "
            f"{', '.join(GLTF_SUFFIXES)}."
        )
    if not len(rig.mesh.vertices) or not len(rig.mesh.polygons):
        raise FacePoserError(f"The {kind} '{path}' has no faces; give one with a surface.")
    if not rig.targets:
        raise FacePoserError(f"The {kind} '{path}' has no shapes; {remedy}.")
    for name, offsets in rig.targets.items():
        finite = np.isfinite(offsets).all(axis=1)
        if not finite.all():
            raise FacePoserError(
                f"The shape '{name}' of the {kind} '{path}' is not finite at vertex {int(np.argmin(finite)) + 1}; "
                "export it again."
            )
    return rig


def empty_targets(rig: MorphMesh) -> tuple[str, ...]:
    """Return the names of the shapes that move nothing."""
    return tuple(name for name, offsets in rig.targets.items() if not offsets.any())
