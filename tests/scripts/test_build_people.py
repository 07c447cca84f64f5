"""The people made with the morphable model."""

import numpy as np

from faceposer.model.character_file import load_character
from scripts.build_assets import differences
from scripts.build_people import PEOPLE, build


def test_the_committed_people_are_as_built() -> None:
    person = PEOPLE[1]
    assert differences(build(person), load_character(person.name)) == []


def test_people_differ() -> None:
    heads = [load_character(name).vertices for name in ("man", "woman", *(person.name for person in PEOPLE))]
    for i, one in enumerate(heads):
        for other in heads[:i]:
            assert np.linalg.norm(one - other, axis=1).mean() > 0.2
