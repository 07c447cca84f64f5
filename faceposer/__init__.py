"""Face Poser: interactive posing of 3D faces with learned priors.

In Python, ``faceposer.load("man")`` returns a face to pose (docs/api.md).
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from faceposer.api import (
        Camera,
        Face,
        FacePoserError,
        FacePoserWarning,
        KeyPoses,
        Performance,
        Pose,
        Trajectories,
        characters,
        feature_pixels,
        feature_places,
        find_all_landmarks,
        find_landmarks,
        find_mesh_landmarks,
        load,
        new_head,
    )

__all__ = [
    "Camera",
    "Face",
    "FacePoserError",
    "FacePoserWarning",
    "KeyPoses",
    "Performance",
    "Pose",
    "Trajectories",
    "characters",
    "feature_pixels",
    "feature_places",
    "find_all_landmarks",
    "find_landmarks",
    "find_mesh_landmarks",
    "load",
    "new_head",
]


def __getattr__(name: str) -> Any:
    # Imported lazily, since commands import this package too, and most of them do not need the interface.
    if name == "subjects":  # former name of this function
        name = "characters"
    if name in __all__:
        from faceposer import api

        return getattr(api, name)
    raise AttributeError(f"module 'faceposer' has no attribute '{name}'")
