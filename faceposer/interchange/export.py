"""One way out: a pose or a performance to whatever format the file's name asks for."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.interchange.glb import write_glb
from faceposer.interchange.live_link import write_live_link
from faceposer.interchange.meshes import write_posed_obj, write_posed_ply
from faceposer.interchange.progress import Progress, no_progress
from faceposer.interchange.weights_json import write_weights
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance

#: What a file holds, by its suffix.
FORMATS: dict[str, str] = {
    ".glb": "the face with its shapes, for Blender, Unity, Unreal and the web; contact is not in them",
    ".obj": "the posed mesh with UVs and groups",
    ".ply": "the posed mesh, binary",
    ".csv": "ARKit weights as Live Link Face writes them",
    ".json": "weights of the face's own shapes",
}
#: Of these, what can hold a performance; a performance of meshes is a folder of them.
ANIMATED = (".glb", ".csv", ".json")
_ONE_FRAME_RATE = 30.0


def write(
    path: Path,
    model: FaceModel,
    motion: NDArray[np.float64] | Performance,
    progress: Progress = no_progress,
    contact: bool = True,
) -> None:
    """Write a face in the format that the suffix of ``path`` names, all or nothing.

    Args:
        path: Ends in one of ``FORMATS``.
        model: The face.
        motion: A pose, shape (r,), or a performance.
        progress: Is told how far it is; what it raises ends the export.
        contact: Whether meshes are written after the contact step; weights and morph targets never have it.

    Raises:
        FacePoserError: If the suffix is none of these, or takes no performance, or the file cannot be written.
    """
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise FacePoserError(f"'{path}' must end in one of {', '.join(FORMATS)}.")
    if suffix == ".glb":
        write_glb(path, model, motion, progress)
    elif suffix == ".csv":
        whole = motion if isinstance(motion, Performance) else Performance(motion[None], _ONE_FRAME_RATE)
        write_live_link(path, model, whole)
    elif suffix == ".json":
        write_weights(path, model, motion)
    elif isinstance(motion, Performance):
        raise FacePoserError(f"'{path}' holds one pose and not {len(motion)}; write a folder of them instead.")
    elif suffix == ".obj":
        write_posed_obj(path, model, motion, contact)
    else:
        write_posed_ply(path, model, motion, contact)
