"""The reading of names that finds most of ARKit's shapes is used, and what it leaves out or drops is said."""

import re
import time

import pytest

from faceposer.errors import FacePoserError
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.name_families import family_hint
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
    "suffix glued to a letter": [f"{with_letters(shape)}Shape" for shape in ARKIT_SHAPES],
    "small suffix glued to a letter": [f"{with_letters(shape)}sh" for shape in ARKIT_SHAPES],
    "suffix glued to a letter without separator": [f"{with_letters(s).replace('_', '')}Mesh" for s in ARKIT_SHAPES],
    "small suffix": [f"{shape.lower()}shape" for shape in ARKIT_SHAPES],
    "large suffix": [f"{shape.upper()}SHAPE" for shape in ARKIT_SHAPES],
    "suffix with a letter of a side": [f"{shape}_rig" for shape in ARKIT_SHAPES],
    "suffix of a deformer": [f"blendShape1|{with_letters(shape)}ShapeOrig" for shape in ARKIT_SHAPES],
    "mesh with a level": [f"head_lod0_mesh__{with_letters(shape)}_x" for shape in ARKIT_SHAPES],
    "three prefixes": [f"facs_{('jnt', 'bs', 'ctrl')[i % 3]}_{capital(s)}" for i, s in enumerate(ARKIT_SHAPES)],
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
    # Seconds of the processor: .3 here, and minutes if any step were quadratic.
    began = time.process_time()
    assert not match_arkit(hostile, "It").shapes
    assert time.process_time() - began < 5.0


@pytest.mark.parametrize(
    ("left", "right", "before"),
    [("Lf", "Rt", False), ("_lft", "_rgt", False), ("lf_", "rt_", True), (" (L)", " (R)", False), (".L", ".R", False)],
)
def test_short_sides(left: str, right: str, before: bool) -> None:
    def spelled(shape: str) -> str:
        if shape in SIDEWAYS or not shape.endswith(("Left", "Right")):
            return shape
        side, stem = left if shape.endswith("Left") else right, re.sub("(Left|Right)$", "", shape)
        return side + stem if before else stem + side

    names = [spelled(shape) for shape in ARKIT_SHAPES]
    assert match_arkit(names, "It").shapes == dict(zip(names, ARKIT_SHAPES, strict=True))


def test_every_reading_is_in_the_note() -> None:
    names = READINGS["three prefixes"]
    note = match_arkit(names, "It").note
    assert all(f"prefix 'facs_{kind}_'" in note for kind in ("jnt", "bs", "ctrl"))
    counts = [int(count) for count in re.findall(r"finds (\d+)", note)]
    assert sum(counts) == 52


@pytest.mark.parametrize(
    ("names", "title"),
    [
        (["Fcl_MTH_A", "Fcl_EYE_Close", "Fcl_BRW_Fun", "Fcl_ALL_Joy"], "VRoid Studio"),
        (["viseme_aa", "viseme_PP", "viseme_O", "viseme_sil"], "visemes"),
        (["A", "I", "U", "Blink_L", "Joy"], "presets of VRM"),
        (["mouth_A", "mouth_B", "mouth_X"], "visemes"),
        (["Brow_Raise_Inner_L", "Mouth_Smile_R", "V_Open"], "Reallusion"),
        (["CTRL_expressions_mouthCornerPullL", "CTRL_expressions_browLateralR", "CTRL_C_jaw"], "MetaHuman"),
        (["AU12_l", "AU1", "AU_26"], "action units"),
        (["あ", "い", "まばたき"], "MikuMikuDance"),
        (["smirk", "grin", "scowl"], ""),
    ],
)
def test_conventions_of_other_programs_are_recognised(names: list[str], title: str) -> None:
    hint = family_hint(names)
    assert (title in hint) if title else hint == ""
