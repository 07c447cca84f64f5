"""Gestures for the seven expressions, at most three actions each (docs/gestures.md)."""

from faceposer.evaluation.gestures.gesture import Gesture, Pull, least, most

_MOUTH = ("mouth", "lip_upper", "lip_lower", "jaw", "neck")
_FACE = (*_MOUTH, "cheek", "nose", "lids", "brow", "forehead", "scalp", "ear")

#: The six basic expressions and contempt (Ekman), each by at most three actions. A pull without an offset moves a place
#: to its neutral position, or pins it there.
EXPRESSIONS = (
    Gesture(
        "happiness",
        "Happiness",
        (Pull("8.3", 5.0, 6.0, both=True), Pull("5.1", 1.5, 6.0, both=True)),
        _FACE,
        (
            least("corner_up", 3.5),
            least("corner_out", 2.0),
            least("cheekSquint", 0.2),
            least("eyeSquint", 0.1),
            least("cheek_up", 1.0),
            most("brow_inner_moved", 1.5),
        ),
        residual=0.6,
    ),
    Gesture(
        "sadness",
        "Sadness",
        (Pull("4.1", 0.0, 5.0, both=True), Pull("8.3", 0.0, -4.0, both=True), Pull("8.2")),
        _FACE,
        (
            least("brow_inner_up", 2.5),
            least("corner_down", 2.4),
            most("brow_outer_up", 2.5),
            most("mouth_opens", 1.0),
            most("lids_close", 0.5),
        ),
        residual=0.6,
    ),
    Gesture(
        "anger",
        "Anger",
        (Pull("4.1", -2.0, -5.0, both=True), Pull("3.1", 0.0, 1.0, both=True), Pull("8.2", 0.0, 2.0)),
        _FACE,
        (least("brow_inner_down", 2.5), least("lower_lip_up", 1.0), most("lids_close", 0.35), most("mouth_opens", 0.5)),
        residual=0.6,
    ),
    Gesture(
        "fear",
        "Fear",
        (Pull("4.1", 0.0, 6.0, both=True), Pull("3.1", 0.0, 2.0, both=True), Pull("8.3", 4.0, -2.0, both=True)),
        _FACE,
        (
            least("brow_inner_up", 2.5),
            least("lids_open", 0.08),
            least("corner_out", 1.5),
            most("corner_up", 1.0),
            most("mouthSmile", 0.2),
            most("mouth_opens", 8.0),
        ),
        residual=0.6,
    ),
    Gesture(
        "surprise",
        "Surprise",
        (Pull("4.3", 0.0, 7.0, both=True), Pull("3.1", 0.0, 2.0, both=True), Pull("2.10", 0.0, -14.0)),
        _FACE,
        (
            least("brow_middle_up", 3.0),
            least("brow_inner_up", 2.0),
            least("mouth_opens", 7.0),
            least("lids_open", 0.08),
            most("corner_up", 0.5),
            most("mouthSmile", 0.2),
        ),
        residual=0.6,
    ),
    Gesture(
        "disgust",
        "Disgust",
        (Pull("9.1", 0.0, 4.0, both=True), Pull("8.1", 0.0, 3.0), Pull("4.1", 0.0, -3.0, both=True)),
        _FACE,
        (
            least("nostril_up", 2.0),
            least("noseSneer", 0.4),
            least("upper_lip_up", 1.8),
            least("brow_inner_down", 1.5),
            most("lids_close", 0.5),
            most("corner_up", 2.0),
        ),
        residual=0.6,
    ),
    Gesture(
        "contempt",
        "Contempt",
        (Pull("8.3", 3.0, 3.0), Pull("8.4"), Pull("8.1")),
        _FACE,
        (least("corner_left_up", 1.5), most("corner_right_up", 0.8), most("mouth_opens", 1.0), most("lids_close", 0.3)),
        residual=0.6,
    ),
)
