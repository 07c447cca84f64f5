"""Python interface: load a face, add constraints, solve, and read vertices and weights (docs/api.md)."""

from faceposer.animation.trajectories import Trajectories
from faceposer.api.face import Face, characters, load, new_head
from faceposer.api.keys import KeyPoses
from faceposer.api.landmarks import find_all_landmarks, find_landmarks, find_mesh_landmarks
from faceposer.errors import FacePoserError, FacePoserWarning
from faceposer.geometry.camera import Camera
from faceposer.landmarks.feature_points import feature_pixels, feature_places
from faceposer.model.performance import Performance
from faceposer.poses.pose_file import Pose

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
