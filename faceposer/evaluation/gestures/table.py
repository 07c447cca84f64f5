"""Table of the gestures of an artist who poses a neutral face, with the expected effects (docs/gestures.md).

A new gesture is one entry. Millimetres are those of a head of 17.5 cm from chin to crown; in the front view, right in
the image is the character's left. Limits on weights apply to characters with ARKit's shapes, limits in millimetres and
shares to all characters.
"""

from faceposer.evaluation.gestures.expressions import EXPRESSIONS
from faceposer.evaluation.gestures.gesture import Gesture, Pull, least, most
from faceposer.evaluation.gestures.lower_face import CHEEKS_AND_NOSE, LOWER_FACE, MOUTH
from faceposer.evaluation.gestures.upper_face import BROWS, LIDS, UPPER_FACE

WHOLE = (
    Gesture(
        "scream",
        "Scream",
        (Pull("2.10", 0.0, -22.0), Pull("8.3", 3.0, 0.0, both=True)),
        (*LOWER_FACE, *UPPER_FACE, "neck", "ear"),
        (least("mouth_opens", 14.0), least("chin_down", 14.0), most("lids_close", 0.5), most("mouthSmile", 0.3)),
    ),
    Gesture(
        "sad",
        "Sad: inner brows up, mouth corners down",
        (Pull("4.1", 0.0, 5.0, both=True), Pull("8.3", 0.0, -4.0, both=True)),
        (*LOWER_FACE, *UPPER_FACE),
        (least("brow_inner_up", 2.5), least("corner_down", 2.4), most("jawOpen", 0.1), most("lids_close", 0.3)),
        residual=0.5,
    ),
)

FIRM = (
    Gesture(
        "hairline_up",
        "Hairline up",
        (Pull("11.1", 4.0, 6.0),),
        ("scalp", "forehead"),
        (most("brow_middle_moved", 1.0), most("lids_close", 0.1)),
        spill_mm=1.0,
        residual=None,
    ),
    Gesture(
        "forehead_up",
        "Forehead up",
        (Pull("forehead", 0.0, 6.0),),
        ("forehead",),
        (most("upper_lid_moved", 1.0),),
        spill_mm=1.0,
        residual=None,
    ),
    Gesture(
        "nose_tip_left",
        "Nose tip to the left",
        (Pull("9.3", 5.0, 0.0),),
        ("nose",),
        (most("upper_lip_moved", 1.0), most("brow_inner_moved", 1.0)),
        spill_mm=1.0,
        residual=None,
    ),
    Gesture(
        "nose_bridge_up",
        "Nose bridge up",
        (Pull("9.12", 0.0, 5.0),),
        ("nose",),
        (most("upper_lip_moved", 1.0), most("brow_inner_moved", 1.0)),
        spill_mm=1.0,
        residual=None,
    ),
    Gesture(
        "ear_out",
        "Left ear out",
        (Pull("10.1", 6.0, 3.0),),
        ("ear", "scalp"),
        (most("mouth_mean", 1.0), most("brow_outer_moved", 1.0)),
        spill_mm=1.0,
        residual=None,
    ),
    Gesture(
        "neck_left",
        "Neck to the left",
        (Pull("neck", 6.0, 0.0),),
        ("neck",),
        (most("chin_moved", 1.0), most("mouth_mean", 1.0)),
        spill_mm=1.0,
        residual=None,
    ),
)

#: All gestures except the expressions, in the order of the tables.
GESTURES: tuple[Gesture, ...] = (*MOUTH, *CHEEKS_AND_NOSE, *BROWS, *LIDS, *WHOLE, *FIRM)
#: All gestures and expressions by name.
BY_NAME = {gesture.name: gesture for gesture in (*GESTURES, *EXPRESSIONS)}
