"""What is measured on heads: attributes of the person, and distances between places of the skin."""

from dataclasses import dataclass

X, Y, Z = 0, 1, 2
#: Places on the base mesh in centimetres, in the middle or on the left.
PLACES = {
    "crown": (0.0, 84.95, 5.8),
    "occiput": (0.0, 76.0, -4.0),
    "temple": (7.0, 78.0, 5.0),
    "hairline": (0.0, 79.9, 14.1),
    "forehead": (0.0, 77.3, 15.2),
    "glabella": (0.0, 75.0, 15.6),
    "nasion": (0.0, 73.3, 15.2),
    "bridge": (0.0, 71.05, 15.83),
    "tip": (0.0, 69.15, 16.82),
    "subnasal": (0.0, 67.89, 15.63),
    "upper lip": (0.0, 66.98, 15.95),
    "lower lip": (0.0, 64.89, 15.56),
    "chin": (0.0, 63.27, 14.99),
    "chin bottom": (0.0, 61.62, 13.6),
    "brow inner": (1.55, 74.8, 15.0),
    "brow middle": (3.7, 75.15, 14.4),
    "brow outer": (5.55, 74.5, 12.6),
    "cheekbone": (5.2, 70.9, 12.2),
    "zygion": (7.0, 71.2, 7.5),
    "cheek": (4.3, 68.2, 13.1),
    "gonion": (6.1, 65.6, 8.0),
    "chin side": (1.9, 62.6, 14.2),
    "wing": (1.78, 69.0, 14.9),
    "bridge side": (0.85, 72.0, 14.9),
    "mouth corner": (2.66, 66.08, 14.35),
    "ear top": (8.0, 73.35, 5.0),
    "ear back": (8.5, 72.0, 3.8),
    "ear root": (7.1, 72.0, 2.0),
    "ear lobe": (7.1, 68.4, 5.8),
    "neck side": (5.0, 58.5, 1.5),
}


@dataclass(frozen=True)
class Measure:
    """A distance between places in centimetres.

    Attributes:
        group: Group of sliders.
        title: Name of the slider.
        less: What its lower end means.
        more: What its upper end means.
        terms: Place, axis and factor of each coordinate that is added.
        relative_to: Measure in proportion to which this one is meant; empty for none. Its value is then the length by
            which the distance differs from the average share of the other one.
    """

    group: str
    title: str
    less: str
    more: str
    terms: tuple[tuple[str, int, float], ...]
    relative_to: str = ""


def _difference(one: str, other: str, axis: int) -> tuple[tuple[str, int, float], ...]:
    return ((one, axis, 1.0), (other, axis, -1.0))


MEASURES = {
    "face-length": Measure("Face", "Face length", "short", "long", _difference("hairline", "chin bottom", Y)),
    "face-width": Measure("Face", "Face width", "narrow", "wide", (("zygion", X, 2.0),)),
    "cheekbones": Measure(
        "Face",
        "Cheekbones",
        "flat",
        "prominent",
        (
            ("cheekbone", X, 0.5),
            ("zygion", X, -0.5),
            ("cheekbone", Z, 0.85),
            ("mouth corner", Z, -0.425),
            ("brow outer", Z, -0.425),
        ),
    ),
    "cheeks": Measure(
        "Face",
        "Cheek fullness",
        "hollow",
        "full",
        (
            ("cheek", X, 0.7),
            ("cheekbone", X, -0.35),
            ("gonion", X, -0.35),
            ("cheek", Z, 0.7),
            ("cheekbone", Z, -0.35),
            ("mouth corner", Z, -0.35),
        ),
    ),
    "head-height": Measure("Face", "Skull height", "low", "high", _difference("crown", "hairline", Y)),
    "head-depth": Measure("Face", "Skull depth", "short", "long", _difference("glabella", "occiput", Z)),
    "head-width": Measure("Face", "Skull width", "narrow", "wide", (("temple", X, 2.0),), "face-width"),
    "forehead-height": Measure(
        "Face", "Forehead height", "low", "high", _difference("hairline", "glabella", Y), "face-length"
    ),
    "forehead-slope": Measure("Face", "Forehead slope", "sloping", "upright", _difference("hairline", "glabella", Z)),
    "jaw-width": Measure("Jaw and chin", "Jaw width", "narrow", "wide", (("gonion", X, 2.0),), "face-width"),
    "jaw-height": Measure(
        "Jaw and chin", "Jaw height", "low", "high", _difference("gonion", "chin bottom", Y), "face-length"
    ),
    "chin-width": Measure("Jaw and chin", "Chin width", "narrow", "wide", (("chin side", X, 2.0),), "face-width"),
    "chin-height": Measure(
        "Jaw and chin", "Chin height", "low", "high", _difference("lower lip", "chin bottom", Y), "face-length"
    ),
    "chin-projection": Measure(
        "Jaw and chin", "Chin depth", "receding", "protruding", _difference("chin", "subnasal", Z)
    ),
    "nose-length": Measure("Nose", "Nose length", "short", "long", _difference("nasion", "subnasal", Y), "face-length"),
    "nose-width": Measure("Nose", "Wing width", "narrow", "wide", (("wing", X, 2.0),)),
    "nose-projection": Measure("Nose", "Nose depth", "flat", "protruding", _difference("tip", "subnasal", Z)),
    "nose-hump": Measure(
        "Nose", "Bridge hump", "hollow", "humped", (("bridge", Z, 1.0), ("nasion", Z, -0.45), ("tip", Z, -0.55))
    ),
    "nose-tip": Measure("Nose", "Tip height", "drooping", "turned up", _difference("tip", "subnasal", Y)),
    "nose-bridge-width": Measure("Nose", "Bridge width", "narrow", "wide", (("bridge side", X, 2.0),)),
    "eye-size": Measure(
        "Eyes",
        "Eye size",
        "small",
        "large",
        (("eye outer", X, 1.0), ("eye inner", X, -1.0), ("eye outer", Z, -0.3), ("eye inner", Z, 0.3)),
    ),
    "eye-distance": Measure(
        "Eyes", "Eye distance", "close", "wide", (("eye outer", X, 1.0), ("eye inner", X, 1.0)), "face-width"
    ),
    "eye-tilt": Measure("Eyes", "Eye tilt", "down", "up", _difference("eye outer", "eye inner", Y)),
    "eye-opening": Measure("Eyes", "Lid opening", "narrow", "open", _difference("upper lid", "lower lid", Y)),
    "eye-depth": Measure(
        "Eyes",
        "Eye depth",
        "deep",
        "bulging",
        (("upper lid", Z, 0.5), ("lower lid", Z, 0.5), ("brow middle", Z, -0.5), ("cheekbone", Z, -0.5)),
    ),
    "brow-height": Measure(
        "Brows",
        "Brow height",
        "low",
        "high",
        (("brow inner", Y, 0.5), ("brow middle", Y, 0.5), ("eye outer", Y, -0.5), ("eye inner", Y, -0.5)),
    ),
    "brow-tilt": Measure("Brows", "Brow tilt", "down", "up", _difference("brow outer", "brow inner", Y)),
    "brow-ridge": Measure(
        "Brows",
        "Brow ridge",
        "flat",
        "heavy",
        (("brow inner", Z, 0.5), ("brow middle", Z, 0.5), ("forehead", Z, -0.5), ("nasion", Z, -0.5)),
    ),
    "mouth-width": Measure("Mouth", "Mouth width", "narrow", "wide", (("mouth corner", X, 2.0),), "face-width"),
    "upper-lip": Measure("Mouth", "Upper lip", "thin", "full", _difference("upper lip", "upper contact", Y)),
    "lower-lip": Measure("Mouth", "Lower lip", "thin", "full", _difference("lower contact", "lower lip", Y)),
    "philtrum": Measure(
        "Mouth", "Philtrum length", "short", "long", _difference("subnasal", "upper lip", Y), "face-length"
    ),
    "mouth-projection": Measure(
        "Mouth",
        "Mouth depth",
        "receding",
        "protruding",
        (("upper lip", Z, 0.5), ("lower lip", Z, 0.5), ("subnasal", Z, -0.5), ("chin", Z, -0.5)),
    ),
    "mouth-corners": Measure("Mouth", "Corner height", "down", "up", _difference("mouth corner", "upper contact", Y)),
    "ear-size": Measure("Ears", "Ear size", "small", "large", _difference("ear top", "ear lobe", Y)),
    "ear-protrusion": Measure("Ears", "Ear angle", "close", "protruding", _difference("ear back", "ear root", X)),
    "neck-width": Measure("Neck", "Neck width", "narrow", "wide", (("neck side", X, 2.0),)),
}

#: Attributes of the whole person: name, title, title of its ends.
PERSON = {
    "gender": ("Gender", "male", "female"),
    "age": ("Age", "young", "old"),
    "weight": ("Weight", "slim", "heavy"),
    "african": ("African", "less", "more"),
    "asian": ("Asian", "less", "more"),
    "caucasian": ("Caucasian", "less", "more"),
}
