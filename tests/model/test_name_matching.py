"""The reading of names that finds most of ARKit's shapes is used, and what it leaves out or drops is said."""

import re
import time

import pytest

from faceposer.errors import FacePoserError
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.name_matching import match_arkit, match_with_ties

SIDEWAYS = ("jawLeft", "jawRight", "mouthLeft", "mouthRight")


def capital(shape: str) -> str:
    return shape[0].upper() + shape[1:]


def with_letters(shape: str) -> str:
    return shape if shape in SIDEWAYS else re.sub("(Left|Right)$", lambda side: f"_{side[0][0]}", shape)


READINGS = {
    "numbers before": [f"{i:02}_{shape}" for i, shape in enumerate(ARKIT_SHAPES)],
    "numbers before, with a dash": [f"{i} - {shape}" for i, shape in enumerate(ARKIT_SHAPES)],
    "numbers glued before": [f"A{i:02}{capital(shape)}" for i, shape in enumerate(ARKIT_SHAPES)],
    "numbers after": [f"{shape}_{i}" for i, shape in enumerate(ARKIT_SHAPES)],
    "numbers glued after": [f"{shape}{i}" for i, shape in enumerate(ARKIT_SHAPES)],
    "suffix of the mesh": [f"{shape}_Head_Mesh" for shape in ARKIT_SHAPES],
    "suffix after a letter": [f"{with_letters(shape)}_Head" for shape in ARKIT_SHAPES],
    "suffix of Maya": [f"{shape}Shape{i}" for i, shape in enumerate(ARKIT_SHAPES)],
    "suffix of Blender": [f"{shape}.001" for shape in ARKIT_SHAPES],
    "number in parentheses": [f"{shape} (1)" for shape in ARKIT_SHAPES],
    "prefix and suffix": [f"BS{i}_{shape}_lod0" for i, shape in enumerate(ARKIT_SHAPES)],
    "capitals": [f"BS_{'_'.join(re.findall('[A-Z]?[a-z]+', shape)).upper()}_GRP" for shape in ARKIT_SHAPES],
    "another script": [f"表情{shape}" for shape in ARKIT_SHAPES],
    "side after the suffix": [re.sub("_([LR])$", r"_Mesh_\1", with_letters(s)) for s in ARKIT_SHAPES],
    "two meshes": [f"{s}_{'Tongue' if s == 'tongueOut' else 'Head'}_Mesh" for s in ARKIT_SHAPES],
    "half with a prefix": [f"Head_{shape}" if i % 2 else shape for i, shape in enumerate(ARKIT_SHAPES)],
}


@pytest.mark.parametrize("reading", READINGS)
def test_affixes_and_numbers_are_left_out(reading: str) -> None:
    names = READINGS[reading]
    match = match_arkit(["Basis", *names, "Joy"], "It")
    assert match.shapes == dict(zip(names, ARKIT_SHAPES, strict=True))
    assert match.others == ("Basis", "Joy")
    assert "are read without their" in match.note


@pytest.mark.parametrize(
    ("names", "used"),
    [
        # The numbered names of Character Creator beside its older ones, some of which denote the same shapes.
        ([*(f"A{i:02}_{s}" for i, s in enumerate(ARKIT_SHAPES)), "Eye_Blink_L", "Mouth_L", "Brow_Drop_L"], "A00_"),
        ([*ARKIT_SHAPES, *(f"{shape}.001" for shape in ARKIT_SHAPES)], "eyeBlinkLeft"),
        ([*ARKIT_SHAPES, *(capital(with_letters(shape)) for shape in ARKIT_SHAPES)], "eyeBlinkLeft"),
        ([f"{shape}_LOD{level}" for level in range(3) for shape in ARKIT_SHAPES], "eyeBlinkLeft_LOD0"),
        ([*ARKIT_SHAPES, *(f"{shape}_50" for shape in ARKIT_SHAPES)], "eyeBlinkLeft"),
    ],
)
def test_of_several_spellings_the_one_of_most_shapes_is_used(names: list[str], used: str) -> None:
    match = match_arkit(names, "It")
    assert len(match.shapes) == 52
    assert next(iter(match.shapes)).startswith(used)
    assert set(match.alternates) == set(names) - set(match.shapes) - {"Brow_Drop_L"}
    assert "not used" in match.note


def test_names_that_mean_something_else_are_not_shapes() -> None:
    for names in (
        ["Joy", "Anger", *(f"corr_{shape}" for shape in ARKIT_SHAPES)],
        [
            f"{shape}_upper"
            for shape in ("jawOpen", "mouthFunnel", "mouthPucker", "mouthClose", "cheekPuff", "tongueOut")
        ],
        [f"{shape}_jawOpen" for shape in ARKIT_SHAPES],
    ):
        assert not match_arkit(names, "It").shapes
    # A correction of a shape that is there is no spelling of it.
    assert not match_arkit([*ARKIT_SHAPES, "fix_jawOpen"], "It").alternates


def test_ties_are_told_and_matter_only_for_shapes() -> None:
    match = match_with_ties(["eyeBlink_L", "EyeBlinkLeft", "Joy", "joy", "tongueOut"])
    assert match.ties == {"eyeBlinkLeft": ("eyeBlink_L", "EyeBlinkLeft")}
    assert match.others == ("Joy", "joy")
    with pytest.raises(FacePoserError, match="both 'eyeBlink_L' and 'EyeBlinkLeft'"):
        match_arkit(["eyeBlink_L", "EyeBlinkLeft"], "It")
    # ARKit's own spelling decides.
    assert match_arkit(["JawOpen", "jawOpen"], "It").shapes == {"jawOpen": "jawOpen"}


def test_time_is_linear_in_the_names() -> None:
    hostile = [":".join("a" * 12000), "_".join(["jaw"] * 4000)]
    hostile += [f"x{i}_" + "_".join(["jaw"] * 60) for i in range(2000)]
    began = time.monotonic()
    assert not match_arkit(hostile, "It").shapes
    assert time.monotonic() - began < 5.0
