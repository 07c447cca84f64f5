"""Rows of the model itself: unseen identities by number of modes, attributes that leave others alone, random heads."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.identity.attributes import ETHNICITIES, PERSON, HeadAttributes
from faceposer.identity.editing import HeadEditor, head_editor
from faceposer.identity.identity import Identity
from faceposer.identity.model import IdentityModel
from faceposer.identity.model_file import load_identity_model
from faceposer.model.character_file import load_character
from scripts.identity_building.learning import Learning
from scripts.identity_study.rows import row
from scripts.study_heads import MEASURED, study

Array = NDArray[np.float64]

#: Seed of identities that the model was not learned from, as of ``build_identity --measure``, and of random heads.
_SEED, _FIRST_HEAD = 7, 10_000
#: Numbers of modes.
_COUNTS = (10, 20, 40, 60, 80, 100)
#: Standard deviation in centimetres of each coordinate in the projection of segments, which have few vertices.
_NOISE = 0.02
#: Allowed share of an attribute's range by which setting another one may change it.
ALLOWED_SHARE = 0.1
#: Samples of the prior on expressions in which each random head is measured.
_DRAWS = 10


def reconstruction_rows(learning: Learning, n: int) -> Iterator[dict[str, Any]]:
    """Yield vertex errors of ``n`` unseen identities: of the mean, of modes, and of modes in each segment."""
    model = load_identity_model()
    heads = learning.heads(_SEED, n, balanced=False)

    def errors(reconstructed: Callable[[Array], Array]) -> tuple[list[Array], float]:
        found, seconds = [], 0.0
        for head in heads:
            began = time.perf_counter()
            result = reconstructed(head)
            seconds += time.perf_counter() - began
            found.append(10.0 * np.linalg.norm(learning.template.skin(result - head), axis=1))
        return found, seconds / n

    found, seconds = errors(lambda _: model.mean_vertices)
    yield row("reconstruction", "mean", 0, found, seconds)
    for count in _COUNTS:
        found, seconds = errors(lambda head, k=count: model.vertices(model.project(head, n_modes=k).coefficients))  # type: ignore[misc]
        yield row("reconstruction", "modes", count, found, seconds)
    for count in _COUNTS:
        found, seconds = errors(lambda head, k=count: _by_segments(model, head, k))  # type: ignore[misc]
        yield row("reconstruction", "segments", count, found, seconds)


def _by_segments(model: IdentityModel, head: Array, count: int) -> Array:
    return model.vertices(model.project_segments(head, _NOISE, count))


@dataclass
class _Largest:
    """Largest changes of other attributes, as shares of their ranges, while one attribute is set.

    Attributes:
        head: In what the model changes, of attributes that are to stay.
        character: The same on the character, after the lips are closed and the lids laid on the eyeballs.
        of: The attribute that changed most there.
        held: On the head, of any other attribute, if all are held.
        missed: Difference of the attribute itself from what was asked for.
    """

    head: float = 0.0
    character: float = 0.0
    of: str = ""
    held: float = 0.0
    missed: float = 0.0


def attribute_rows(n: int) -> Iterator[dict[str, Any]]:
    """Yield, for each attribute, how much setting it in ``n`` random heads changes others, relative to their range.

    It is set to one end of its range in even heads and to the other end in odd ones. Attributes of the person, such as
    age, are to leave each other alone and to change the face; attributes of the face are to leave all others alone. The
    last row is the worst.
    """
    editor = head_editor(load_character("man"))
    attributes = editor.attributes
    names = attributes.names
    ranges = {name: float(np.ptp(attributes[name].limits)) for name in names}
    stay = {name: _to_stay(attributes, name) for name in names}
    largest = {name: _Largest() for name in names}
    began = time.perf_counter()
    for number in range(n):
        head = editor.random(_FIRST_HEAD + number)
        before, shown = editor.measure(head), _measured(editor, head)
        for name in names:
            value, found = attributes[name].limits[number % 2], largest[name]
            changed = editor.with_attributes(head, {name: value})
            after = editor.measure(changed)
            found.missed = max(found.missed, abs(after[name] - value) / ranges[name])
            found.head = max(found.head, _most(before, after, ranges, stay[name])[0])
            found.character, found.of = max(
                (found.character, found.of), _most(shown, _measured(editor, changed), ranges, stay[name])
            )
            if attributes[name].group == PERSON:
                after = editor.measure(editor.with_attributes(head, {name: value}, names))
            found.held = max(found.held, _most(before, after, ranges, _to_stay(attributes, name, held=True))[0])
    seconds = (time.perf_counter() - began) / (n * len(names))
    worst = max(names, key=lambda name: largest[name].character)
    for name, label in [*((name, name) for name in names), (worst, f"worst: {worst}")]:
        found = largest[name]
        shares = {key: round(getattr(found, key), 4) for key in ("head", "character", "held", "missed")}
        holds = max(found.head, found.character, found.held) <= ALLOWED_SHARE
        yield {"test": "attributes", "method": label, "n": n, **shares, "of": found.of, "holds": holds} | {
            "seconds": round(seconds, 3)
        }


def _to_stay(attributes: HeadAttributes, name: str, held: bool = False) -> list[str]:
    """Return the attributes that are to stay when ``name`` is set, without those that add up to zero with it."""
    person = attributes[name].group == PERSON and not held
    return [
        other.name
        for other in attributes.attributes
        if other.name != name
        and not (name in ETHNICITIES and other.name in ETHNICITIES)
        and (other.group == PERSON or not person)
    ]


def _most(
    before: Mapping[str, float], after: Mapping[str, float], ranges: Mapping[str, float], names: Sequence[str]
) -> tuple[float, str]:
    """Return the largest change of the attributes ``names`` as a share of their ranges, and which it is."""
    return max((abs(after[name] - before[name]) / ranges[name], name) for name in names)


def _measured(editor: HeadEditor, head: Identity) -> dict[str, float]:
    """Return the attributes of the skin that the character gets."""
    return editor.attributes.measure(editor.maker.head(editor.skin(head)).vertices[: editor.template.n_skin])


def head_rows(n: int) -> Iterator[dict[str, Any]]:
    """Yield what ``n`` random heads leave open in a blink and how deep parts intersect, by ``scripts.study_heads``."""
    model = load_identity_model()
    began = time.perf_counter()
    found = [study(model.instance(head), _DRAWS, seed) for seed, head in enumerate(model.sample(0, n))]
    yield {
        "test": "heads",
        "method": "random",
        "modes": model.n_coefficients,
        "n": n,
        "poses": sum(each["poses"] for each in found),
        "blink_gap_mm_max": round(max(each["blink_gap_mm"] for each in found), 4),
        **{f"{kind}_mm_max": round(max(each["deepest_mm"][kind] for each in found), 4) for kind in MEASURED},
        "poses_over": {kind: sum(each["over"][kind] for each in found) for kind in MEASURED},
        "seconds": round((time.perf_counter() - began) / n, 2),
    }
