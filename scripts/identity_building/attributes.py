"""Attributes of heads: what is measured, and the offsets that change one measurement and keep the others.

Attributes of the whole person (gender, age, ...) are regressed on heads with labels: for heads x = D t + n with
MakeHuman's directions D, labels t and the covariance C of all other variation, the best unbiased linear estimate is
t = (D' C^-1 D)^-1 D' C^-1 x, in which the size is a further, unknown label; C is that of the statistics. Attributes of the face are
distances between places of the skin along the axes of the head. With L for all these functionals, the shortest change
of x in the metric of C that changes measurement k by 1 and no other is column k of C L' (L C L')^-1: equation (3) of
V. Blanz and T. Vetter, "A morphable model for the synthesis of 3D faces" (1999), with further equations that keep the
other attributes.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from faceposer.identity.attributes import quantised, without_motion
from faceposer.identity.model import IdentityModel
from scripts.asset_building.builder import Builder
from scripts.asset_building.head import LASH_RING, Skin
from scripts.asset_building.landmarks import hidden_ids
from scripts.asset_building.piece import Floats, Ints
from scripts.identity_building.targets import HeadTargets

#: Share of the range of a pair of details, from no change to its end, that counts as one standard deviation.
_DETAIL_DEVIATION = 0.12
#: Deviation of what the modes do not explain along each of them, in the unit of the length of a whole head.
_UNEXPLAINED = 4.0
#: Details that belong to the weight of a head, which the macro targets change little.
_WEIGHT_DETAILS = {"head/fat": 0.8}
#: Details that move so much of the skull that they would stand in for anything.
_LEFT_OUT = ("forehead/nubian", "head/angle", "ears/trans")
#: Standard deviations from the average head to the end of an attribute's range.
_RANGE = 2.5
#: Natural values of attributes of the person, in MakeHuman's labels relative to the average head.
_LIMITS = {
    "gender": (-1.5, 1.5),
    "age": (-0.8, 1.4),
    "weight": (-2.2, 2.2),
    "african": (-0.45, 0.7),
    "asian": (-0.45, 0.7),
    "caucasian": (-0.45, 0.7),
}
#: Root mean square of the odd part of a head, in centimetres, at the end of the slider.
_ASYMMETRY = 0.12
_CREDITS = (
    "Directions of people and details of faces: MakeHuman's targets (CC0 1.0). Covariance: the morphable model of "
    "identity.npz."
)

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
    "face-length": Measure("Face", "Length of the face", "short", "long", _difference("hairline", "chin bottom", Y)),
    "face-width": Measure("Face", "Width of the face", "narrow", "wide", (("zygion", X, 2.0),)),
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
        "Fullness of the cheeks",
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
    "head-height": Measure("Face", "Height of the skull", "low", "high", _difference("crown", "hairline", Y)),
    "head-depth": Measure("Face", "Depth of the skull", "short", "long", _difference("glabella", "occiput", Z)),
    "head-width": Measure("Face", "Width of the skull", "narrow", "wide", (("temple", X, 2.0),), "face-width"),
    "forehead-height": Measure(
        "Face", "Height of the forehead", "low", "high", _difference("hairline", "glabella", Y), "face-length"
    ),
    "forehead-slope": Measure("Face", "Forehead", "sloping", "upright", _difference("hairline", "glabella", Z)),
    "jaw-width": Measure("Jaw and chin", "Width of the jaw", "narrow", "wide", (("gonion", X, 2.0),), "face-width"),
    "jaw-height": Measure(
        "Jaw and chin", "Corner of the jaw", "low", "high", _difference("gonion", "chin bottom", Y), "face-length"
    ),
    "chin-width": Measure(
        "Jaw and chin", "Width of the chin", "narrow", "wide", (("chin side", X, 2.0),), "face-width"
    ),
    "chin-height": Measure(
        "Jaw and chin", "Height of the chin", "low", "high", _difference("lower lip", "chin bottom", Y), "face-length"
    ),
    "chin-projection": Measure("Jaw and chin", "Chin", "receding", "protruding", _difference("chin", "subnasal", Z)),
    "nose-length": Measure(
        "Nose", "Length of the nose", "short", "long", _difference("nasion", "subnasal", Y), "face-length"
    ),
    "nose-width": Measure("Nose", "Width of the wings", "narrow", "wide", (("wing", X, 2.0),)),
    "nose-projection": Measure("Nose", "Depth of the nose", "flat", "protruding", _difference("tip", "subnasal", Z)),
    "nose-hump": Measure(
        "Nose", "Bridge of the nose", "hollow", "humped", (("bridge", Z, 1.0), ("nasion", Z, -0.45), ("tip", Z, -0.55))
    ),
    "nose-tip": Measure("Nose", "Tip of the nose", "drooping", "turned up", _difference("tip", "subnasal", Y)),
    "nose-bridge-width": Measure("Nose", "Width of the bridge", "narrow", "wide", (("bridge side", X, 2.0),)),
    "eye-size": Measure(
        "Eyes",
        "Size of the eyes",
        "small",
        "large",
        (("eye outer", X, 1.0), ("eye inner", X, -1.0), ("eye outer", Z, -0.3), ("eye inner", Z, 0.3)),
    ),
    "eye-distance": Measure(
        "Eyes", "Distance of the eyes", "close", "wide", (("eye outer", X, 1.0), ("eye inner", X, 1.0)), "face-width"
    ),
    "eye-tilt": Measure("Eyes", "Tilt of the eyes", "down", "up", _difference("eye outer", "eye inner", Y)),
    "eye-opening": Measure("Eyes", "Lids", "narrow", "open", _difference("upper lid", "lower lid", Y)),
    "eye-depth": Measure(
        "Eyes",
        "Depth of the eyes",
        "deep",
        "bulging",
        (("upper lid", Z, 0.5), ("lower lid", Z, 0.5), ("brow middle", Z, -0.5), ("cheekbone", Z, -0.5)),
    ),
    "brow-height": Measure(
        "Brows",
        "Height of the brows",
        "low",
        "high",
        (("brow inner", Y, 0.5), ("brow middle", Y, 0.5), ("eye outer", Y, -0.5), ("eye inner", Y, -0.5)),
    ),
    "brow-tilt": Measure("Brows", "Tilt of the brows", "down", "up", _difference("brow outer", "brow inner", Y)),
    "brow-ridge": Measure(
        "Brows",
        "Brow ridge",
        "flat",
        "heavy",
        (("brow inner", Z, 0.5), ("brow middle", Z, 0.5), ("forehead", Z, -0.5), ("nasion", Z, -0.5)),
    ),
    "mouth-width": Measure("Mouth", "Width of the mouth", "narrow", "wide", (("mouth corner", X, 2.0),), "face-width"),
    "upper-lip": Measure("Mouth", "Upper lip", "thin", "full", _difference("upper lip", "upper contact", Y)),
    "lower-lip": Measure("Mouth", "Lower lip", "thin", "full", _difference("lower contact", "lower lip", Y)),
    "philtrum": Measure(
        "Mouth", "Distance of nose and mouth", "short", "long", _difference("subnasal", "upper lip", Y), "face-length"
    ),
    "mouth-projection": Measure(
        "Mouth",
        "Mouth",
        "receding",
        "protruding",
        (("upper lip", Z, 0.5), ("lower lip", Z, 0.5), ("subnasal", Z, -0.5), ("chin", Z, -0.5)),
    ),
    "mouth-corners": Measure(
        "Mouth", "Corners of the mouth", "down", "up", _difference("mouth corner", "upper contact", Y)
    ),
    "ear-size": Measure("Ears", "Size of the ears", "small", "large", _difference("ear top", "ear lobe", Y)),
    "ear-protrusion": Measure("Ears", "Ears", "close", "protruding", _difference("ear back", "ear root", X)),
    "neck-width": Measure("Neck", "Width of the neck", "narrow", "wide", (("neck side", X, 2.0),)),
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


def person_directions(targets: HeadTargets, details: dict[str, Floats]) -> Floats:
    """Return MakeHuman's directions of `PERSON`, one unit of its labels each, shape (P, 3 C)."""
    macros = targets.macros()
    for name, share in _WEIGHT_DETAILS.items():
        macros["weight"] = macros["weight"] + share * details[name]
    return np.stack([macros[name] for name in PERSON])


def variation(person: Floats, details: dict[str, Floats], modes: Floats) -> Floats:
    """Return a factor F of the covariance F F' of heads that are the same on both sides, shape (R, 3 C).

    Args:
        person: Directions of `PERSON`, shape (P, 3 C).
        details: MakeHuman's details.
        modes: Modes of the statistics times their deviations, even part, shape (M, 3 C).
    """
    kept = [offsets for name, offsets in details.items() if name not in (*_WEIGHT_DETAILS, *_LEFT_OUT)]
    return np.concatenate([modes, 0.5 * person, _DETAIL_DEVIATION * np.stack(kept)])


def person_functionals(place: Floats, person: Floats, modes: Floats) -> Floats:
    """Return the functionals that estimate the labels of `PERSON`, shape (P, 3 C).

    Only what the statistics explain is used: elsewhere, MakeHuman's heads differ from scans by their style.

    Args:
        place: The average head, shape (C, 3).
        person: Directions of `PERSON`; those of the ethnicities add up to zero. Shape (P, 3 C).
        modes: Modes times their deviations, even part, shape (M, 3 C).
    """
    n = len(person)
    contrast = np.eye(n)[:, :-1]
    contrast[-1, -2:] = -1.0
    # With t = contrast s, the directions of n - 1 independent labels s; the shares of the ethnicities add up to zero.
    size = (place - place.mean(axis=0)).reshape(1, -1)
    unknown = np.concatenate([contrast.T @ person, size])
    # Coefficients of a head in deviations, between which differences of people have unit covariance.
    coefficients = np.linalg.solve(modes @ modes.T + _UNEXPLAINED**2 * np.eye(len(modes)), modes)
    return contrast @ (np.linalg.pinv(coefficients @ unknown.T) @ coefficients)[: n - 1]


def place_ids(skin: Skin, place: Floats, outside: Ints) -> dict[str, int]:
    """Return the control vertex of each place, in the middle or on the left.

    Args:
        skin: Topology of the skin.
        place: The control mesh on the base mesh, shape (C, 3).
        outside: Control vertices outside of mouth and sockets, shape (O,).
    """
    middle = outside[np.abs(place[outside, 0]) < 1e-6]
    found = {}
    for name, target in PLACES.items():
        candidates = outside if target[0] else middle
        found[name] = int(candidates[cKDTree(place[candidates]).query(target)[1]])
    ring = np.asarray(skin.rings_left[LASH_RING])
    x, y = (place[ring, :2] - place[ring, :2].mean(axis=0)).T
    found["eye outer"], found["eye inner"] = int(ring[x.argmax()]), int(ring[x.argmin()])
    for name, above in (("upper lid", y > 0), ("lower lid", y < 0)):
        found[name] = int(ring[np.where(above, np.abs(x), np.inf).argmin()])
    contact = np.asarray(skin.lip_contact)
    contact = contact[np.abs(place[contact, 0]) < 1e-6]
    found["upper contact"], found["lower contact"] = (
        int(contact[place[contact, 1].argmax()]),
        int(contact[place[contact, 1].argmin()]),
    )
    return found


def face_functionals(skin: Skin, ids: dict[str, int], average: Floats) -> Floats:
    """Return the functionals of `MEASURES`, means of both sides, shape (G, 3 C).

    Args:
        skin: Topology of the skin.
        ids: Control vertex of each place.
        average: The average head, shape (C, 3).
    """
    names = list(MEASURES)
    rows = np.zeros((len(MEASURES), len(skin.base_ids), 3))
    for row, measure in zip(rows, MEASURES.values(), strict=True):
        for name, axis, factor in measure.terms:
            left = ids[name]
            row[left, axis] += 0.5 * factor
            row[skin.mirror[left], axis] += -0.5 * factor if axis == X else 0.5 * factor
    absolute = rows.reshape(len(MEASURES), -1)
    lengths = absolute @ average.ravel()
    result = absolute.copy()
    for k, measure in enumerate(MEASURES.values()):
        if measure.relative_to:
            whole = names.index(measure.relative_to)
            result[k] -= lengths[k] / lengths[whole] * absolute[whole]
    return result


def build_attributes(builder: Builder, model: IdentityModel) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return metadata and arrays of the file of attributes, for heads of ``model``."""
    targets, skin = HeadTargets(builder), builder.skin
    c = len(skin.base_ids)
    details = targets.details()
    person = person_directions(targets, details)
    modes = np.stack([targets.even(mode.ravel()) for mode in model.basis])
    factor = variation(person, details, modes)
    smoothing = skin.fine.matrix[:c]

    def points(rows: Floats) -> Floats:
        return np.stack([(smoothing @ row.reshape(c, 3)).ravel() for row in rows])

    average = smoothing @ model.mean_vertices
    # "caucasian" is minus the sum of the other two.
    labels = person_functionals(average, points(person), points(modes))[:-1]
    outside = np.setdiff1d(np.arange(c), hidden_ids(skin, builder.place))
    lengths = face_functionals(skin, place_ids(skin, builder.place[:c], outside.astype(np.int32)), average)
    rows = np.concatenate([labels, lengths])
    free = without_motion(rows, average, targets.weights)
    directions = (free @ points(factor).T) @ factor
    spread = np.sqrt(np.square(free @ points(modes).T).sum(axis=1))
    patterns = np.stack(list(targets.asymmetries().values()))
    arrays: dict[str, NDArray[Any]] = {
        **quantised("functionals", rows.reshape(-1, c, 3)),
        **quantised("directions", directions.reshape(-1, c, 3)),
        **quantised("patterns", patterns.reshape(-1, c, 3)),
        "weights": targets.weights.astype(np.uint8),
    }
    entries: list[dict[str, Any]] = []

    def add(
        name: str,
        group: str,
        texts: tuple[str, str, str],
        unit: str = "",
        average: float = 0.0,
        scale: float = 1.0,
        limits: tuple[float, float] = (-1.0, 1.0),
        relative_to: str = "",
    ) -> None:
        entry = dict(zip(("title", "less", "more"), texts, strict=True))
        entries.append(
            {
                "name": name,
                "group": group,
                **entry,
                "unit": unit,
                "average": average,
                "scale": scale,
                "limits": limits,
                "relative_to": relative_to,
            }
        )

    for name in [name for name in PERSON if name != "caucasian"]:
        add(name, "Person", PERSON[name], limits=_LIMITS.get(name, (-1.0, 1.0)))
    for (name, measure), row, deviation in zip(MEASURES.items(), lengths, spread[len(labels) :], strict=True):
        middle = float(row @ average.ravel()) if not measure.relative_to else 0.0
        add(
            name,
            measure.group,
            (measure.title, measure.less, measure.more),
            "cm",
            middle,
            _RANGE * float(deviation),
            relative_to=measure.relative_to,
        )
    add("caucasian", "Person", PERSON["caucasian"], limits=_LIMITS["caucasian"])
    add("asymmetry", "Face", ("Asymmetry", "even", "uneven"), "cm", 0.0, _ASYMMETRY, (0.0, 1.0))
    return {"attributes": entries, "credits": _CREDITS}, arrays
