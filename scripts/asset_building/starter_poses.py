"""Starter poses as weights of ARKit's shapes; a name without a side means both sides.

Expressions: the action units (AU) of Ekman and Friesen's Facial Action Coding System for each of the six basic
emotions and contempt, realised with the nearest ARKit shapes. Visemes: the thirteen of J. Lander, "Read My Lips: Facial
Animation Techniques", Game Developer, 2000.
"""

from dataclasses import dataclass, field

from faceposer.model.character import ARKIT_SHAPES


@dataclass(frozen=True)
class Starter:
    """Pose of the starter set.

    Attributes:
        stem: Stem of its file name, by which the poses are sorted.
        name: Displayed name.
        note: One-sentence description.
        weights: Weights of ARKit's shapes.
        creature: Weights of face units that differ on the goblin, including units of the ears.
    """

    stem: str
    name: str
    note: str
    weights: dict[str, float]
    creature: dict[str, float] = field(default_factory=dict)

    @property
    def tag(self) -> str:
        """Kind of pose, "expression" or "viseme"."""
        return self.stem.split("-")[0]

    def sided(self) -> dict[str, float]:
        """Return the weights by the names of ARKit's shapes, in ARKit's order."""
        given = {}
        for name, weight in self.weights.items():
            names = [name] if name in ARKIT_SHAPES else [name + side for side in ("Left", "Right")]
            given.update(dict.fromkeys(names, weight))
        return {name: given[name] for name in ARKIT_SHAPES if name in given}


STARTERS = (
    Starter(
        "expression-1-happiness",
        "Happiness",
        "Cheeks raised, corners of the lips pulled up, lips parted: FACS action units 6 + 12 + 25.",
        {
            "mouthSmile": 1.0,
            "mouthUpperUp": 0.2,
            "mouthShrugUpper": 0.3,
            "mouthLowerDown": 0.35,
            "jawOpen": 0.15,
            "cheekSquint": 0.95,
            "eyeSquint": 0.05,
        },
        {"mouthSmile": 1.15, "mouthUpperUp": 0.3, "jawOpen": 0.2, "cheekSquint": 0.8, "eyeSquint": 0.3, "earUp": 0.5},
    ),
    Starter(
        "expression-2-sadness",
        "Sadness",
        "Inner brows raised and drawn together, corners of the lips down, chin up: FACS action units 1 + 4 + 15 + 17.",
        {
            "browInnerUp": 1.15,
            "browDown": 0.25,
            "mouthFrown": 0.7,
            "mouthShrugLower": 0.55,
            "eyeSquint": 0.15,
            "eyeBlink": 0.15,
            "eyeLookDown": 0.35,
        },
        {
            "browInnerUp": 1.15,
            "browDown": 0.0,
            "mouthFrown": 0.85,
            "mouthShrugLower": 0.5,
            "eyeSquint": 0.0,
            "eyeBlink": 0.22,
            "earDown": 1.0,
        },
    ),
    Starter(
        "expression-3-surprise",
        "Surprise",
        "Brows raised, eyes wide, jaw dropped: FACS action units 1 + 2 + 5 + 26.",
        {
            "browInnerUp": 0.85,
            "browOuterUp": 0.85,
            "eyeWide": 0.8,
            "jawOpen": 0.6,
            "mouthFunnel": 0.2,
        },
        {"browInnerUp": 0.9, "browOuterUp": 1.0, "eyeWide": 0.8, "jawOpen": 0.85, "earUp": 0.9},
    ),
    Starter(
        "expression-4-fear",
        "Fear",
        "Brows raised and drawn together, eyes wide, lips stretched aside: FACS action units 1 + 2 + 4 + 5 + 20 + 25.",
        {
            "browInnerUp": 1.0,
            "browOuterUp": 0.3,
            "browDown": 0.65,
            "eyeWide": 1.0,
            "mouthStretch": 1.0,
            "mouthUpperUp": 0.15,
            "mouthLowerDown": 0.5,
            "jawOpen": 0.12,
        },
        {
            "browInnerUp": 1.1,
            "browOuterUp": 0.15,
            "browDown": 0.0,
            "eyeWide": 0.95,
            "eyeSquint": 0.0,
            "mouthStretch": 1.1,
            "mouthFrown": 0.35,
            "mouthLowerDown": 0.6,
            "mouthUpperUp": 0.15,
            "jawOpen": 0.25,
            "earBack": 0.8,
            "earDown": 0.7,
        },
    ),
    Starter(
        "expression-5-anger",
        "Anger",
        "Brows lowered, eyes glaring, lids and lips tight: FACS action units 4 + 5 + 7 + 23 + 24.",
        {
            "browDown": 1.0,
            "eyeWide": 0.75,
            "eyeSquint": 0.45,
            "noseSneer": 0.45,
            "mouthPress": 0.4,
            "mouthFrown": 0.25,
            "mouthRollLower": 0.25,
            "mouthRollUpper": 0.25,
            "mouthShrugLower": 0.15,
            "jawForward": 0.2,
        },
        {
            "browDown": 1.25,
            "eyeWide": 0.5,
            "eyeSquint": 0.25,
            "noseSneer": 0.55,
            "mouthPress": 0.4,
            "mouthFrown": 0.75,
            "mouthRollLower": 0.1,
            "mouthRollUpper": 0.1,
            "earBack": 1.0,
        },
    ),
    Starter(
        "expression-6-disgust",
        "Disgust",
        "Nose wrinkled, upper lip raised, corners of the lips and lower lip down: FACS action units 9 + 10 + 15 + 16.",
        {
            "noseSneer": 1.0,
            "mouthUpperUp": 0.9,
            "mouthShrugUpper": 0.25,
            "mouthFrown": 0.35,
            "mouthLowerDown": 0.2,
            "mouthShrugLower": 0.3,
            "browDown": 0.5,
            "eyeWide": 0.15,
            "eyeSquint": 0.4,
            "cheekSquint": 0.4,
        },
        {
            "noseSneer": 1.0,
            "mouthUpperUp": 0.75,
            "mouthFrown": 0.5,
            "mouthLowerDown": 0.1,
            "mouthShrugLower": 0.4,
            "browDown": 0.3,
            "eyeSquint": 0.6,
            "cheekSquint": 0.6,
            "earBack": 0.4,
            "earDown": 0.3,
        },
    ),
    Starter(
        "expression-7-contempt",
        "Contempt",
        "One corner of the lips tightened and raised: FACS action units 12 + 14, on the left.",
        {
            "mouthSmileLeft": 0.55,
            "mouthDimpleLeft": 1.0,
            "mouthPressRight": 0.15,
            "cheekSquintLeft": 0.3,
            "eyeBlink": 0.2,
            "eyeSquint": 0.1,
            "browOuterUpLeft": 0.25,
        },
        {"mouthSmileLeft": 0.9, "earDown": 0.3},
    ),
    Starter(
        "viseme-01-mbp",
        "M B P",
        "Lips closed: mom, bob, pop.",
        {
            "mouthPress": 0.2,
            "mouthRollLower": 0.2,
            "mouthRollUpper": 0.2,
            "mouthClose": 0.03,
            "jawOpen": 0.04,
        },
        {"mouthPress": 0.1, "mouthRollLower": 0.3, "mouthRollUpper": 0.3, "jawOpen": 0.06},
    ),
    Starter(
        "viseme-02-w",
        "W OO",
        "Lips pursed: we, boot.",
        {
            "mouthPucker": 1.0,
            "mouthFunnel": 0.1,
        },
        {"mouthPucker": 1.1},
    ),
    Starter(
        "viseme-03-r",
        "R",
        "Lips rounded and open, corners drawn in a little: red, book.",
        {
            "mouthPucker": 0.6,
            "mouthFunnel": 0.2,
            "jawOpen": 0.15,
        },
        {"mouthPucker": 0.7},
    ),
    Starter(
        "viseme-04-fv",
        "F V",
        "Lower lip at the upper teeth: fat, vat.",
        {
            "mouthRollLower": 0.8,
            "mouthUpperUp": 0.55,
            "mouthShrugLower": 0.1,
            "jawOpen": 0.03,
        },
        {"mouthRollLower": 1.0, "mouthUpperUp": 0.6},
    ),
    Starter(
        "viseme-05-th",
        "TH",
        "Tongue between the teeth: think, that.",
        {
            "jawOpen": 0.18,
            "tongueOut": 0.54,
            "mouthUpperUp": 0.25,
            "mouthLowerDown": 0.2,
        },
    ),
    Starter(
        "viseme-06-l",
        "L",
        "Teeth a little apart, tip of the tongue behind the upper ones: lot.",
        {
            "jawOpen": 0.17,
            "tongueOut": 0.1,
            "mouthUpperUp": 0.4,
            "mouthLowerDown": 0.45,
            "mouthStretch": 0.1,
        },
    ),
    Starter(
        "viseme-07-dst",
        "D S T N",
        "Lips relaxed, teeth nearly closed: dot, sit, zoo, not.",
        {"jawOpen": 0.07, "mouthUpperUp": 0.25, "mouthLowerDown": 0.45, "mouthStretch": 0.15},
    ),
    Starter(
        "viseme-08-ch",
        "CH SH J",
        "Teeth nearly closed, lips pushed forward, corners tight: chime, shy, jive, vision.",
        {
            "jawOpen": 0.06,
            "mouthFunnel": 0.75,
            "mouthPucker": 0.1,
            "mouthUpperUp": 0.25,
            "mouthLowerDown": 0.35,
        },
    ),
    Starter(
        "viseme-09-kg",
        "K G NG",
        "Mouth slightly open, teeth nearly closed: keg, hang, yes.",
        {"jawOpen": 0.17, "mouthUpperUp": 0.15, "mouthLowerDown": 0.25},
    ),
    Starter(
        "viseme-10-ee",
        "EE",
        "Mouth wide and slightly open: beat, bit.",
        {
            "mouthStretch": 0.45,
            "mouthSmile": 0.35,
            "mouthDimple": 0.2,
            "mouthUpperUp": 0.25,
            "mouthLowerDown": 0.35,
            "jawOpen": 0.1,
        },
    ),
    Starter(
        "viseme-11-eh",
        "EH",
        "Jaw dropped a little, teeth apart: bait, bet, but.",
        {"jawOpen": 0.28, "mouthStretch": 0.25, "mouthLowerDown": 0.25, "mouthUpperUp": 0.1},
    ),
    Starter(
        "viseme-12-oh",
        "OH",
        "Lips round, jaw dropped a little: boat.",
        {
            "jawOpen": 0.42,
            "mouthFunnel": 0.4,
            "mouthPucker": 0.7,
        },
        {"mouthPucker": 0.8, "mouthFunnel": 0.6},
    ),
    Starter(
        "viseme-13-ah",
        "AH",
        "Jaw dropped far: bat, bought.",
        {
            "jawOpen": 0.65,
            "mouthLowerDown": 0.15,
            "mouthUpperUp": 0.1,
        },
    ),
)
