"""MakeHuman's targets on the control mesh of our skin, with the motion and size of the body taken out."""

from collections.abc import Callable, Iterable
from itertools import product

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import factorized

from scripts.asset_building.builder import Builder
from scripts.asset_building.identity import NECK_TOP
from scripts.asset_building.piece import Floats

#: MakeHuman's names of the macro targets.
ETHNICITIES, GENDERS, AGES = ("african", "asian", "caucasian"), ("male", "female"), ("young", "old")

#: Details in opposite pairs: folder, name, end of the one and of the other; "l-" and "r-" are added where sided.
_PAIRED = {
    "chin": "bones:decr:incr cleft:decr:incr height:decr:incr jaw-drop:decr:incr prognathism:decr:incr "
    "prominent:decr:incr width:decr:incr",
    "cheek": "bones:decr:incr inner:decr:incr trans:down:up volume:decr:incr",
    "ears": "flap:decr:incr lobe:decr:incr rot:backward:forward scale:decr:incr scale-depth:decr:incr "
    "scale-vert:decr:incr trans:backward:forward trans:down:up wing:decr:incr",
    "eyebrows": "angle:down:up trans:backward:forward trans:down:up",
    "eyes": "bag:decr:incr corner1:down:up corner2:down:up eyefold:concave:convex eyefold:down:up height1:decr:incr "
    "height2:decr:incr height3:decr:incr push1:in:out push2:in:out scale:decr:incr trans:down:up trans:in:out",
    "forehead": "nubian:decr:incr scale-vert:decr:incr temple:decr:incr trans:backward:forward",
    "head": "angle:in:out back-scale-depth:decr:incr fat:decr:incr scale-depth:decr:incr scale-horiz:decr:incr "
    "scale-vert:decr:incr",
    "mouth": "angles:down:up cupidsbow:decr:incr cupidsbow-width:decr:incr lowerlip-height:decr:incr "
    "lowerlip-volume:decr:incr lowerlip-width:decr:incr philtrum-volume:decr:incr scale-depth:decr:incr "
    "scale-horiz:decr:incr scale-vert:decr:incr trans:backward:forward trans:down:up upperlip-height:decr:incr "
    "upperlip-volume:decr:incr upperlip-width:decr:incr",
    "neck": "scale-depth:decr:incr scale-horiz:decr:incr",
    "nose": "base:down:up compression:compress:uncompress curve:concave:convex flaring:decr:incr greek:decr:incr "
    "hump:decr:incr nostrils-angle:down:up nostrils-width:decr:incr point:down:up point-width:decr:incr "
    "scale-depth:decr:incr scale-horiz:decr:incr scale-vert:decr:incr septumangle:decr:incr "
    "trans:backward:forward trans:down:up volume:decr:incr width1:decr:incr width2:decr:incr width3:decr:incr",
}
_SIDED = ("cheek", "ears", "eyes")
#: Kinds of asymmetry with the number of targets of each.
_ASYMMETRIES = {"brown": 2, "cheek": 2, "ear": 4, "eye": 8, "jaw": 3, "mouth": 2, "nose": 4, "temple": 2}
#: Height on the base mesh in centimetres above which a vertex says how the head as a whole has moved.
HEAD_FROM = 63.0


class HeadTargets:
    """Offsets of targets on the control mesh of the skin, in centimetres, shape (3 C,)."""

    def __init__(self, builder: Builder) -> None:
        """Prepare the removal of motion and size, and the levelling of the neck's end."""
        self._source, self._n = builder.source, len(builder.rest)
        skin = self.skin = builder.skin
        self.place: Floats = builder.rest[skin.base_ids]
        self.mirror = skin.mirror
        self.weights = (self.place[:, 1] > HEAD_FROM).astype(float)
        similarity = np.concatenate([rigid_generators(self.place), self.place.reshape(-1, 1)], axis=1)
        rows = np.repeat(self.weights, 3)
        self._similarity, self._fit = similarity, np.linalg.pinv(similarity * rows[:, None]) * rows
        self._level = _levelling(builder)

    def target(self, *names: str) -> Floats:
        """Return the sum of targets, cleaned."""
        offsets = sum(10.0 * self._source.target(name, self._n) for name in names)
        return self.cleaned(offsets[self.skin.base_ids])

    def cleaned(self, offsets: Floats) -> Floats:
        """Return ``offsets`` (C, 3) without rigid motion and change of size, the neck's end in its plane."""
        flat = offsets.ravel()
        free = (flat - self._similarity @ (self._fit @ flat)).reshape(-1, 3)
        return self._level(free).ravel()

    def mirrored(self, offsets: Floats) -> Floats:
        """Return ``offsets`` (3 C,) of the mirror image."""
        return (offsets.reshape(-1, 3)[self.mirror] * [-1.0, 1.0, 1.0]).ravel()

    def even(self, offsets: Floats) -> Floats:
        """Return the part of ``offsets`` (3 C,) that is the same on both sides."""
        return 0.5 * (offsets + self.mirrored(offsets))

    def macros(self) -> dict[str, Floats]:
        """Return directions of gender, age, weight, muscle and each ethnicity, averaged over all others.

        Gender runs from -1 (male) to 1 (female), age from 0 (25 years) to 1 (90 years), weight and muscle from -1 (as
        little as possible) to 1; an ethnicity is the difference to the mean of the others.
        """

        def mean(parts: Iterable[Floats]) -> Floats:
            return np.mean(list(parts), axis=0)

        def head(ethnicity: str, gender: str, age: str) -> Floats:
            build = f"universal-{gender}-{age}-averagemuscle-averageweight"
            return self.target(f"macrodetails/{ethnicity}-{gender}-{age}", f"macrodetails/{build}")

        def build(gender: str, age: str, muscle: str, weight: str) -> Floats:
            return self.target(f"macrodetails/universal-{gender}-{age}-{muscle}muscle-{weight}weight")

        heads = {key: head(*key) for key in product(ETHNICITIES, GENDERS, AGES)}

        def where(place: int, value: str) -> Floats:
            return mean(h for key, h in heads.items() if key[place] == value)

        found = {"gender": 0.5 * (where(1, "female") - where(1, "male")), "age": where(2, "old") - where(2, "young")}
        people = list(product(GENDERS, AGES))
        found["weight"] = 0.5 * mean(build(*who, "average", "max") - build(*who, "average", "min") for who in people)
        found["muscle"] = 0.5 * mean(build(*who, "max", "average") - build(*who, "min", "average") for who in people)
        for one in ETHNICITIES:
            found[one] = where(0, one) - mean(where(0, other) for other in ETHNICITIES if other != one)
        return {name: self.even(offsets) for name, offsets in found.items()}

    def details(self) -> dict[str, Floats]:
        """Return half the difference of each pair of opposite details, the same on both sides."""
        found = {}
        for folder, listed in _PAIRED.items():
            for entry in listed.split():
                name, less, more = entry.split(":")
                sides = ("l-", "r-") if folder in _SIDED else ("",)
                ends = []
                for end in (less, more):
                    stem = {"eyes": "eye", "ears": "ear"}.get(folder, folder)
                    ends.append(self.target(*(f"{folder}/{side}{stem}-{name}-{end}" for side in sides)))
                found[f"{folder}/{name}"] = self.even(0.5 * (ends[1] - ends[0]))
        return found

    def asymmetries(self) -> dict[str, Floats]:
        """Return the odd part of each target of asymmetry."""
        found = {}
        for kind, count in _ASYMMETRIES.items():
            for k in range(1, count + 1):
                offsets = self.target(f"asym/asym-{kind}-{k}-l")
                found[f"{kind}-{k}"] = offsets - self.even(offsets)
        return found


def rigid_generators(points: Floats) -> Floats:
    """Return the offsets of unit translations and rotations of ``points`` (N, 3), shape (3 N, 6)."""
    moves = [np.broadcast_to(axis, points.shape) for axis in np.eye(3)]
    turns = [np.cross(axis, points - points.mean(axis=0)) for axis in np.eye(3)]
    return np.stack([offsets.ravel() for offsets in moves + turns], axis=1)


def _levelling(builder: Builder) -> Callable[[Floats], Floats]:
    """Return the function that takes vertical motion out of the neck's border, fading out below the jaw."""
    skin = builder.skin
    n = len(skin.base_ids)
    a, b = np.stack([skin.quads, np.roll(skin.quads, -1, axis=1)], axis=-1).reshape(-1, 2).T
    links = sparse.csr_array((np.ones(len(a)), (a, b)), shape=(n, n))
    links = links + links.T
    laplacian = sparse.csr_array(sparse.diags_array(links.sum(axis=1)) - links)
    border = np.zeros(n, dtype=bool)
    border[skin.border] = True
    known = border | (builder.base.vertices[skin.base_ids, 1] > NECK_TOP)
    solve = factorized(laplacian[~known][:, ~known].tocsc())
    to_known = sparse.csr_array(laplacian[~known][:, known])

    def level(offsets: Floats) -> Floats:
        change = np.zeros(n)
        change[border] = -offsets[border, 1]
        change[~known] = solve(-(to_known @ change[known]))
        return offsets + change[:, None] * [0.0, 1.0, 0.0]

    return level
