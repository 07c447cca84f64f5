"""Characters of the study: the built-in ones, and rigs from other sources."""

import os
from pathlib import Path

from faceposer.errors import FacePoserError
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.session.opening import load_model
from faceposer.training.request import TrainingRequest, train

SHIPPED = ("man", "woman", "low", "creature")
#: Files in the folder FACEPOSER_RIGS, without suffix.
RIGS = ("facecap", "facecap_multi")
CHARACTERS = (*SHIPPED, *RIGS)


def load_study_character(name: str) -> FaceModel:
    """Load the face called ``name``; a rig is imported as by *File > Import character*.

    Raises:
        FacePoserError: If it cannot be found or read.
    """
    if name not in RIGS:
        return load_model(name)
    folder = os.environ.get("FACEPOSER_RIGS")
    if not folder:
        raise FacePoserError(f"'{name}' needs {name}.glb; set FACEPOSER_RIGS to the folder that contains it.")
    return build_face_model(train(TrainingRequest("rig", Path(folder) / f"{name}.glb", name, name)))
