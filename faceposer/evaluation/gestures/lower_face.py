"""Gestures on mouth, jaw, cheeks and nose; conventions as in ``table.py``."""

from faceposer.evaluation.gestures.gesture import Gesture, Paint, Pull, least, most
from faceposer.evaluation.gestures.upper_face import EYES_OPEN

#: Regions that gestures on the lower face may move.
LOWER_FACE = ("mouth", "lip_upper", "lip_lower", "cheek", "nose", "jaw", "lids")
_MOUTH_SHUT = most("mouth_opens", 0.5)
# A smile may part the lips.
_LIPS_PARTED = most("mouth_opens", 2.0)

MOUTH = (
    Gesture(
        "corner_up_left",
        "Left mouth corner up and out",
        (Pull("8.3", 4.2, 4.2),),
        LOWER_FACE,
        (least("corner_left_up", 2.8), most("jawOpen", 0.1), _LIPS_PARTED, most("brow_inner_moved", 1.0)),
        other_side=0.6,
    ),
    Gesture(
        "corner_up_left_three_quarter",
        "Left mouth corner up, from three-quarter",
        (Pull("8.3", 2.0, 6.0, "three-quarter"),),
        LOWER_FACE,
        (least("corner_left_up", 4.0), most("jawOpen", 0.1), _LIPS_PARTED, most("brow_inner_moved", 1.0)),
        other_side=0.6,
    ),
    Gesture(
        "corners_up",
        "Both mouth corners up",
        (Pull("8.3", 0.0, 6.0, both=True),),
        LOWER_FACE,
        (
            least("corner_up", 4.0),
            least("cheekSquint", 0.2),
            least("eyeSquint", 0.1),
            least("cheek_up", 0.8),
            most("jawOpen", 0.1),
            _LIPS_PARTED,
            most("brow_inner_moved", 1.0),
        ),
    ),
    Gesture(
        "corners_up_out",
        "Both mouth corners up and out",
        (Pull("8.3", 4.2, 4.2, both=True),),
        LOWER_FACE,
        (
            least("corner_up", 2.8),
            least("corner_out", 2.5),
            least("mouthSmile", 0.3),
            least("cheekSquint", 0.2),
            least("eyeSquint", 0.1),
            least("cheek_up", 0.8),
            most("jawOpen", 0.1),
            _LIPS_PARTED,
            most("brow_inner_moved", 1.0),
        ),
    ),
    Gesture(
        "corner_out_left",
        "Left mouth corner out",
        (Pull("8.3", 5.0, 0.0),),
        LOWER_FACE,
        (least("corner_left_out", 3.0), most("jawOpen", 0.1), EYES_OPEN),
        other_side=0.6,
    ),
    Gesture(
        "corners_out",
        "Both mouth corners out",
        (Pull("8.3", 5.0, 0.0, both=True),),
        LOWER_FACE,
        (least("corner_out", 3.0), most("jawOpen", 0.1), EYES_OPEN, most("brow_inner_moved", 1.0)),
    ),
    Gesture(
        "corner_down_left",
        "Left mouth corner down",
        (Pull("8.3", 0.0, -4.0),),
        LOWER_FACE,
        (least("corner_left_down", 2.4), most("jawOpen", 0.1), _MOUTH_SHUT),
        other_side=0.6,
    ),
    Gesture(
        "corners_down",
        "Both mouth corners down",
        (Pull("8.3", 0.0, -4.0, both=True),),
        LOWER_FACE,
        (least("corner_down", 2.4), most("jawOpen", 0.1), _MOUTH_SHUT, EYES_OPEN),
    ),
    Gesture(
        "pucker_points",
        "Pucker by two points",
        (Pull("8.3", -6.0, 0.0, both=True),),
        LOWER_FACE,
        (least("corner_in", 3.9), least("upper_lip_forward", 0.5), most("jawOpen", 0.15), EYES_OPEN),
    ),
    Gesture(
        "pucker_stroke",
        "Pucker by one stroke",
        (Paint(("8.4", "2.7", "2.2", "2.6", "8.3"), narrower=0.7),),
        LOWER_FACE,
        (least("corner_in", 3.0), least("upper_lip_forward", 0.5), most("jawOpen", 0.15), EYES_OPEN),
        residual=0.6,
    ),
    Gesture(
        "upper_lip_up",
        "Upper lip up",
        (Pull("8.1", 0.0, 4.0),),
        LOWER_FACE,
        (least("upper_lip_up", 2.4), most("jawOpen", 0.1), EYES_OPEN, most("corner_up", 2.5)),
    ),
    Gesture(
        "lower_lip_down",
        "Lower lip down",
        (Pull("8.2", 0.0, -10.0),),
        (*LOWER_FACE, "neck"),
        (least("lower_lip_down", 6.5), least("mouth_opens", 5.0), EYES_OPEN, most("brow_inner_moved", 1.0)),
    ),
    Gesture(
        "jaw_down",
        "Jaw down",
        (Pull("2.10", 0.0, -12.0),),
        (*LOWER_FACE, "neck", "ear"),
        (
            least("chin_down", 7.8),
            least("mouth_opens", 6.0),
            most("corner_up", 0.5),
            EYES_OPEN,
            most("brow_inner_moved", 1.0),
        ),
    ),
    Gesture(
        "jaw_left",
        "Jaw to the left",
        (Pull("2.10", 6.0, 0.0),),
        (*LOWER_FACE, "neck", "ear"),
        (
            least("chin_left", 3.9),
            most("mouth_opens", 3.0),
            most("corner_up", 2.5),
            EYES_OPEN,
            most("brow_inner_moved", 1.0),
        ),
    ),
    Gesture(
        "jaw_forward",
        "Jaw forward, in profile",
        (Pull("2.10", 5.0, 0.0, "right"),),
        (*LOWER_FACE, "neck", "ear"),
        (
            least("chin_forward", 3.2),
            most("lip_overhang", 2.0),
            most("mouth_opens", 3.0),
            EYES_OPEN,
            most("brow_inner_moved", 1.0),
        ),
    ),
)

CHEEKS_AND_NOSE = (
    Gesture(
        "cheek_up_left",
        "Left cheek up",
        (Pull("5.1", 0.0, 4.0),),
        LOWER_FACE,
        (least("cheek_left_up", 2.4), _MOUTH_SHUT, most("lids_right_close", 0.15), most("brow_inner_moved", 1.0)),
        other_side=0.6,
    ),
    Gesture(
        "cheeks_up",
        "Both cheeks up",
        (Pull("5.1", 0.0, 4.0, both=True),),
        LOWER_FACE,
        (least("cheek_up", 2.4), _MOUTH_SHUT, most("lids_close", 0.5), most("brow_inner_moved", 1.0)),
    ),
    Gesture(
        "cheeks_out",
        "Both cheeks out",
        (Pull("5.1", 4.0, 0.0, both=True),),
        LOWER_FACE,
        (least("cheek_out", 2.4), _MOUTH_SHUT, EYES_OPEN, most("mouthSmile", 0.2), most("brow_inner_moved", 1.0)),
    ),
    Gesture(
        "nose_wrinkle",
        "Nose wrinkled",
        (Pull("9.1", 0.0, 3.0, both=True),),
        (*LOWER_FACE, "brow"),
        (
            least("nostril_up", 1.8),
            least("noseSneer", 0.3),
            most("jawOpen", 0.1),
            _MOUTH_SHUT,
            most("lids_close", 0.35),
        ),
    ),
    Gesture(
        "snarl_left",
        "Snarl on the left",
        (Pull("8.5", 0.5, 5.0), Pull("9.1", 0.0, 2.0)),
        (*LOWER_FACE, "brow"),
        (least("upper_lip_half_left_up", 3.2), most("jawOpen", 0.1), most("lids_right_close", 0.2)),
        other_side=0.6,
    ),
)
