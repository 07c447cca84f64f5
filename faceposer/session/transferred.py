"""Transfer of a session's pose and animation to another character."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from faceposer.animation.keyframes import Key
from faceposer.model.face_model import FaceModel
from faceposer.session.document import Document
from faceposer.transfer.transfer import Transfer


def transferred(
    document: Document, coefficients: NDArray[np.float64], transfer: Transfer, character: str, target: FaceModel
) -> Document:
    """Return the pose and all keys of a session, transferred to another character.

    Constraints and photos are left out: they refer to the original face.

    Args:
        document: Document of the session.
        coefficients: Its pose, shape (r,).
        transfer: Transfer from its character to the target.
        character: Name or file of the target character.
        target: Model of the target character.
    """
    new = Document(
        character,
        prior_weight=document.prior_weight,
        prior=document.prior,
        spread=document.spread,
        frame=document.frame,
        animated=False,
        contact=document.contact,
        sketch_method=document.sketch_method,
    )
    keyframes, pose = document.keyframes, None
    if keyframes is not None:
        poses: list[NDArray[np.float64]] = []
        for key in keyframes.keys:
            poses.append(transfer.pose(key.pose, poses[-1] if poses else None))
        keys = tuple(Key.of(key.frame, moved) for key, moved in zip(keyframes.keys, poses, strict=True))
        keyframes = replace(keyframes, keys=keys)
        new = replace(new, keyframes=keyframes, animated=document.animated and bool(keys))
        if new.animated:
            pose = keyframes.sampled(target, [document.frame])[0]
    if pose is None:
        pose = transfer.pose(coefficients)
    return new.with_start(pose).posed(pose)
