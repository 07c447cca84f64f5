"""The characters of the study: those that come with the program, and rigs of other makers."""

import os
from pathlib import Path

from faceposer.errors import FacePoserError
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.session.opening import load_model
from faceposer.training.request import TrainingRequest, train

SHIPPED = ("man", "woman", "low", "creature")
#: Files of the folder FACEPOSER_RIGS, without their suffix.
RIGS = ("facecap", "facecap_multi")
CHARACTERS = (*SHIPPED, *RIGS)


def load_study_character(name: str) -> FaceModel:
    """Return the face called ``name``; a rig is imported as *File > Import character* does.

    Raises:
        FacePoserError: If it cannot be found or read.
    """
    if name not in RIGS:
        return load_model(name)
    folder = os.environ.get("FACEPOSER_RIGS")
    if not folder:
        raise FacePoserError(f"'{name}' needs the environment variable FACEPOSER_RIGS, the folder with {name}.glb.")
    return build_face_model(train(TrainingRequest("rig", Path(folder) / f"{name}.glb", name, name)))
