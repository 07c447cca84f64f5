"""Rigs for tests, made of the shipped ones."""

from dataclasses import replace

import numpy as np

from faceposer.model.shape_names import weight_map
from faceposer.model.subject import ARKIT_SHAPES, Subject


def with_wholes(subject: Subject) -> Subject:
    """Return ``subject`` with exactly ARKit's 52 shapes: wholes in the place of halves."""
    lift = weight_map(subject.shape_names, ARKIT_SHAPES).astype(np.float32)
    shapes = np.tensordot(lift.T, subject.shapes, axes=1)
    return replace(subject, shape_names=ARKIT_SHAPES, shapes=shapes, shape_limits=np.zeros((0, 2), dtype=np.float32))
