"""Attributes of heads: their functionals, and the offsets that change one measurement and keep the others.

Attributes of the whole person (gender, age, ...) are regressed on heads with labels: for heads x = D t + n with
MakeHuman's directions D, labels t and the covariance C of the statistics, the best unbiased linear estimate is
t = (D' C^-1 D)^-1 D' C^-1 x, in which the size is a further, unknown label. Attributes of the face are distances
between places of the skin along the axes of the head. With L for all these functionals, the shortest change
of x in the metric of C that changes measurement k by 1 and no other is column k of C L' (L C L')^-1: equation (3) of
V. Blanz and T. Vetter, "A morphable model for the synthesis of 3D faces" (1999), with further equations that keep the
other attributes.
"""

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
from scripts.identity_building.measures import MEASURES, PERSON, PLACES, X
from scripts.identity_building.targets import HeadTargets

#: Share of the range of a pair of details, from no change to its end, that counts as one standard deviation.
_DETAIL_DEVIATION = 0.12
#: Distance from the contact of the lips over which they are held together, in centimetres.
_LIP_REACH = 0.45
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


def without_opening_lips(offsets: Floats, place: Floats, contact: Ints) -> Floats:
    """Return ``offsets`` (..., C, 3) of a head in which the lips stay together along their contact.

    Each lip moves by half of what would open them, less with the distance from the contact, as lips of characters do.
    The function is linear, so that it holds for offsets of either sign.

    Args:
        offsets: Offsets of control vertices.
        place: The head, whose lips are closed, shape (C, 3).
        contact: The closed loop of vertices along which the lips touch.
    """
    loop = np.roll(contact, -int(place[contact, 0].argmax()))
    end = int(place[loop, 0].argmin())
    lower, upper = sorted(
        (loop[: end + 1][::-1], np.append(loop[end:], loop[0])), key=lambda half: place[half, 1].mean()
    )
    x, ends = place[:, 0], (place[loop, 0].min(), place[loop, 0].max())
    # Differences of the heights at each place of the loop, as weights of its vertices.
    weights = np.zeros((len(loop), len(place)))
    for sign, half in ((1.0, upper), (-1.0, lower)):
        for vertex in half:
            weights[:, vertex] += sign * np.interp(x[loop], x[half], (half == vertex).astype(np.float64))
    gap = offsets[..., 1] @ weights.T
    away, nearest = cKDTree(place[loop]).query(place)
    middle = np.interp(
        np.clip(x, *ends), x[upper], 0.5 * (place[upper, 1] + np.interp(x[upper], x[lower], place[lower, 1]))
    )
    towards = np.where(place[:, 1] > middle, -0.5, 0.5)
    towards[upper[1:-1]], towards[lower[1:-1]] = -0.5, 0.5
    result = offsets.copy()
    result[..., 1] += gap[..., nearest] * (towards * np.exp(-((away / _LIP_REACH) ** 2)))
    return result


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
    factor = variation(person, details, modes).reshape(-1, c, 3)
    factor = without_opening_lips(factor, model.mean_vertices, skin.lip_contact).reshape(len(factor), -1)
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
