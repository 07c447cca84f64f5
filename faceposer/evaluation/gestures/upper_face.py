"""Gestures on brows and lids; conventions as in ``table.py``."""

from faceposer.evaluation.gestures.gesture import Gesture, Pull, least, most

#: Regions that gestures on the upper face may move.
UPPER_FACE = ("brow", "forehead", "lids", "nose", "scalp", "cheek")
#: The eyes remain open.
EYES_OPEN = most("lids_close", 0.15)

BROWS = ("brow", "forehead", "lids", "nose", "scalp", "cheek")
EYES_OPEN = most("lids_close", 0.15)
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

BROWS = (
    Gesture(
        "brow_up_left",
        "Left brow up",
        (Pull("4.3", 0.0, 6.0),),
        UPPER_FACE,
        (least("brow_middle_left_up", 3.9), EYES_OPEN, most("mouth_mean", 0.05)),
        other_side=0.25,
    ),
    Gesture(
        "brow_up_left_three_points",
        "Left brow up by three points",
        (Pull("4.1", 0.0, 5.0), Pull("4.3", 0.0, 5.0), Pull("4.5", 0.0, 5.0)),
        UPPER_FACE,
        (least("brow_middle_left_up", 3.25), EYES_OPEN, most("mouth_mean", 0.05)),
        other_side=0.25,
    ),
    Gesture(
        "brow_up_left_three_quarter",
        "Left brow up, from three-quarter",
        (Pull("4.3", 0.0, 6.0, "three-quarter"),),
        UPPER_FACE,
        (least("brow_middle_left_up", 3.9), EYES_OPEN, most("mouth_mean", 0.05)),
        other_side=0.25,
    ),
    Gesture(
        "brows_up",
        "Both brows up",
        (Pull("4.3", 0.0, 6.0, both=True),),
        UPPER_FACE,
        (least("brow_middle_up", 3.9), most("lids_close", 0.05), most("mouth_mean", 0.05)),
    ),
    Gesture(
        "brow_down_left",
        "Left brow down",
        (Pull("4.3", 0.0, -4.0),),
        UPPER_FACE,
        (least("brow_middle_left_down", 2.6), most("eyeBlink", 0.15), most("mouth_mean", 0.05)),
        other_side=0.6,
    ),
    Gesture(
        "brows_down",
        "Both brows down",
        (Pull("4.3", 0.0, -4.0, both=True),),
        UPPER_FACE,
        (least("brow_middle_down", 2.6), most("eyeBlink", 0.15), most("lids_close", 0.3), most("mouth_mean", 0.05)),
    ),
    Gesture(
        "brows_inner_down",
        "Both inner brows down",
        (Pull("4.1", -1.0, -5.0, both=True),),
        UPPER_FACE,
        (
            least("brow_inner_down", 3.25),
            least("browDown", 0.3),
            most("eyeBlink", 0.15),
            most("lids_close", 0.3),
            most("jawOpen", 0.05),
            most("mouth_mean", 0.1),
        ),
    ),
    Gesture(
        "brows_inner_up",
        "Both inner brows up",
        (Pull("4.1", 0.0, 5.0, both=True),),
        UPPER_FACE,
        (least("brow_inner_up", 3.25), most("brow_outer_up", 2.5), EYES_OPEN, most("mouth_mean", 0.05)),
    ),
    Gesture(
        "brow_inner_up_left",
        "Left inner brow up",
        (Pull("4.1", 0.0, 5.0),),
        UPPER_FACE,
        (least("brow_inner_left_up", 3.25), EYES_OPEN, most("mouth_mean", 0.05)),
        other_side=0.5,
    ),
    Gesture(
        "brows_outer_up",
        "Both outer brows up",
        (Pull("4.5", 0.0, 5.0, both=True),),
        UPPER_FACE,
        (least("brow_outer_up", 3.25), most("brow_inner_up", 2.5), EYES_OPEN, most("mouth_mean", 0.05)),
    ),
    Gesture(
        "brows_together",
        "Inner brows together and down",
        (Pull("4.1", -1.5, -3.5, both=True),),
        UPPER_FACE,
        (least("brow_inner_in", 0.6), most("eyeBlink", 0.15), most("lids_close", 0.3), most("mouth_mean", 0.1)),
    ),
)

LIDS = (
    Gesture(
        "lids_close",
        "Both eyes closed by the upper lids",
        (Pull("3.1", both=True, onto="3.3"),),
        UPPER_FACE,
        (least("lids_close", 0.7), most("lids_close", 1.15), most("brow_middle_moved", 1.5), most("mouth_mean", 0.1)),
    ),
    Gesture(
        "lids_open",
        "Both eyes widened",
        (Pull("3.1", 0.0, 2.0, both=True),),
        UPPER_FACE,
        (least("lids_open", 0.12), most("brow_middle_moved", 1.5), most("mouth_mean", 0.05)),
    ),
    Gesture(
        "lower_lids_up",
        "Both lower lids up",
        (Pull("3.3", 0.0, 2.5, both=True),),
        UPPER_FACE,
        (least("lower_lid_up", 1.5), most("upper_lid_down", 2.0), most("mouth_mean", 0.1)),
    ),
    Gesture(
        "wink_left",
        "Wink with the left eye",
        (Pull("3.1", onto="3.3"),),
        UPPER_FACE,
        (
            least("lids_left_close", 0.7),
            most("lids_left_close", 1.15),
            most("lids_right_close", 0.3),
            most("mouth_mean", 0.3),
        ),
    ),
)
