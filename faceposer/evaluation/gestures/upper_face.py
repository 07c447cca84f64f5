"""Gestures on brows and lids; conventions as in ``table.py``."""

from faceposer.evaluation.gestures.gesture import Gesture, Pull, least, most

#: Regions that gestures on the upper face may move.
UPPER_FACE = ("brow", "forehead", "lids", "nose", "scalp", "cheek")
#: The eyes remain open.
EYES_OPEN = most("lids_close", 0.15)

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
