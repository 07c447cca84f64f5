"""Gestures on mouth, jaw, cheeks and nose; conventions as in ``table.py``."""

from faceposer.evaluation.gestures.gesture import Gesture, Paint, Pull, least, most
from faceposer.evaluation.gestures.upper_face import EYES_OPEN

#: Regions that gestures on the lower face may move.
LOWER_FACE = ("mouth", "lip_upper", "lip_lower", "cheek", "nose", "jaw", "lids")
_MOUTH_SHUT = most("mouth_opens", 0.5)
# A smile may part the lips.
_LIPS_PARTED = most("mouth_opens", 2.0)

MOUTH = ("mouth", "lip_upper", "lip_lower")
LOWER_FACE = (*_MOUTH, "cheek", "nose", "jaw", "lids")
_
