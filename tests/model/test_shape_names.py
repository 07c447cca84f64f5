"""ARKit's names are known however they are spelled, and nothing else is taken for one."""

import os
import re
import time
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.gltf_io import read_gltf
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.name_matching import match_arkit
from faceposer.model.shape_names import (
    SPLIT_SHAPES,
    canonical_shape,
    half_shapes_of,
    makers,
    weight_map,
    whole_shape_of,
)

SIDEWAYS = {"jawLeft", "jawRight", "mouthLeft", "mouthRight"}


def words(shape: str) -> list[str]:
    return re.findall("[A-Z]?[a-z]+", shape)


def short(shape: str) -> list[str]:
    """Return the words of ``shape``, its side as one letter."""
    parts = words(shape)
    return parts if shape in SIDEWAYS or parts[-1] not in ("Left", "Right") else [*parts[:-1], parts[-1][0]]


def side_first(shape: str) -> list[str]:
    parts = short(shape)
    return [parts[-1], *parts[:-1]] if len(parts[-1]) == 1 else parts


SPELLINGS = {
    "own": lambda s: s,
    "vrm": lambda s: s[0].upper() + s[1:],
    "capitals": lambda s: "_".join(words(s)).upper(),
    "snake": lambda s: "_".join(words(s)).lower(),
    "dashes": lambda s: "-".join(words(s)).lower(),
    "spaces": lambda s: " ".join(words(s)).title(),
    "letter": lambda s: "".join(short(s)),
    "letter after underscore": lambda s: re.sub("_?([LR])$", r"_\1", "".join(short(s))),
    "letter after dot": lambda s: re.sub("([LR])$", r".\1", "".join(short(s))),
    "small letter": lambda s: "_".join(short(s)).lower(),
    "letter first": lambda s: "_".join(side_first(s)),
    "side first": lambda s: "_".join(side_first(s)).replace("L_", "Left_").replace("R_", "Right_"),
    "dotted prefix": lambda s: f"blendShape1.{s}",
    "dotted prefix and letter": lambda s: "head.001." + re.sub("([LR])$", r".\1", "".join(short(s))),
    "colon prefix": lambda s: f"mesh:{s}",
    "path": lambda s: f"group|head_geo.{s}",
}


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_every_shape_is_known_in_every_spelling(spelling: str) -> None:
    spell = SPELLINGS[spelling]
    for shape in (*ARKIT_SHAPES, *SPLIT_SHAPES):
        assert canonical_shape(spell(shape)) == shape, spell(shape)
    match = match_arkit([spell(shape) for shape in ARKIT_SHAPES], "It")
    assert list(match.shapes.values()) == list(ARKIT_SHAPES)
    assert not match.missing
    assert not match.others


@pytest.mark.parametrize("prefix", ["Head_", "head01_", "Head", "char-v2 ", "my_char.head_"])
def test_a_prefix_that_all_names_have(prefix: str) -> None:
    names = [prefix + shape[0].upper() + shape[1:] for shape in ARKIT_SHAPES]
    match = match_arkit(names, "It")
    assert match.shapes == dict(zip(names, ARKIT_SHAPES, strict=True))
    # Some names without it, as Blender's basis.
    match = match_arkit(["Basis", *names, "jawOpen_mouthClose"], "It")
    assert match.shapes == dict(zip(names, ARKIT_SHAPES, strict=True))
    assert match.others == ("Basis", "jawOpen_mouthClose")
    # A prefix that all have, among names of which most are not ARKit's.
    match = match_arkit([*(f"{prefix}Vowel{i}" for i in range(200)), *names], "It")
    assert match.shapes == dict(zip(names, ARKIT_SHAPES, strict=True))


@pytest.mark.parametrize(
    "names",
    [
        # Corrections of one shape in company with others, and a few of something among much else.
        ["jawOpen_mouthClose", "jawOpen_mouthSmile_L"],
        ["Joy", "Anger", "Sorrow", "fix_jawOpen", "fix_mouthLeft"],
        ["mouthSmile_jawOpen"],
    ],
)
def test_a_prefix_that_means_something_is_kept(names: list[str]) -> None:
    match = match_arkit(names, "It")
    assert match.others == tuple(names)
    assert not match.shapes


@pytest.mark.parametrize(
    "name",
    [
        *("", "_", "L", "Left", "mouth", "jaw", "smile", "mouthSmile", "eyeBlink", "Joy", "A", "neutral", "HeadYaw"),
        *("eyeBlinkLeftRight", "LeftEyeBlinkLeft", "jawOpenLeft", "L_jaw", "Head_eyeBlinkLeft", "Timecode"),
        *("mouthClose_jawOpen", "jawOpen2", "tongueOutLeft", "mouthRollLowerL", "leftjaw"),
    ],
)
def test_other_names_are_not_taken_for_shapes(name: str) -> None:
    assert canonical_shape(name) is None


def test_names_without_end_take_no_time() -> None:
    began = time.process_time()
    for name in ("a:" * 200_000, ":" * 400_000, "._/|" * 100_000, "mesh." * 100_000 + "jawOpen"):
        assert canonical_shape(name) == ("jawOpen" if name.endswith("jawOpen") else None)
    assert time.process_time() - began < 2.0


def test_no_spelling_means_two_shapes() -> None:
    spelled = [SPELLINGS[k](shape).lower() for k in SPELLINGS for shape in (*ARKIT_SHAPES, *SPLIT_SHAPES)]
    owners: dict[str, set[str | None]] = {}
    for name in spelled:
        owners.setdefault(re.sub(r"\W|_", "", name), set()).add(canonical_shape(name))
    assert all(len(shapes) == 1 for shapes in owners.values())


def test_the_variant_of_ict_has_halves() -> None:
    halved = [shape for shape in ARKIT_SHAPES if shape not in ("browInnerUp", "cheekPuff", "tongueOut")]
    names = [re.sub("(Left|Right)$", lambda m: f"_{m[0][0]}", s) if s not in SIDEWAYS else s for s in halved]
    names += ["browInnerUp_L", "browInnerUp_R", "cheekPuff_L", "cheekPuff_R"]
    match = match_arkit(names, "It")
    assert len(match.shapes) == 53
    assert match.shapes["browInnerUp_L"] == "browInnerUpLeft"
    assert match.shapes["cheekPuff_R"] == "cheekPuffRight"
    assert match.shapes["mouthLeft"] == "mouthLeft"
    assert match.missing == ("tongueOut",)


def test_what_is_missing_and_what_is_not_arkits_is_told() -> None:
    match = match_arkit(["JawOpen", "Wink", "cheekPuff_L"], "It")
    assert match.shapes == {"JawOpen": "jawOpen", "cheekPuff_L": "cheekPuffLeft"}
    assert match.others == ("Wink",)
    assert len(match.missing) == 50
    assert not {"jawOpen", "cheekPuff"} & set(match.missing)
    assert match_arkit([], "It").missing == ARKIT_SHAPES


@pytest.mark.parametrize(
    ("one", "other", "shape"),
    [("eyeBlink_L", "EyeBlinkLeft", "eyeBlinkLeft"), ("head.jawOpen", "teeth.jawOpen", "jawOpen")],
)
def test_two_names_of_one_shape_are_refused(one: str, other: str, shape: str) -> None:
    with pytest.raises(FacePoserError, match=f"The rig 'a' has both '{one}' and '{other}', .* same shape, {shape};"):
        match_arkit([one, "tongueOut", other], "The rig 'a'")
    # The same name twice is one name.
    assert match_arkit([one, one], "It").shapes == {one: shape}


def test_a_real_rig() -> None:
    folder = os.environ.get("FACEPOSER_RIGS")
    if not folder:
        pytest.skip("FACEPOSER_RIGS is not set")
    match = match_arkit(read_gltf(Path(folder) / "facecap.glb").targets, "It")
    assert set(match.shapes.values()) == set(ARKIT_SHAPES)
    assert match.shapes["mouthSmile_L"] == "mouthSmileLeft"
    assert not match.missing


def test_halves_and_wholes_know_each_other() -> None:
    assert half_shapes_of("browInnerUp") == ("browInnerUpLeft", "browInnerUpRight")
    assert half_shapes_of("jawOpen") == half_shapes_of("mouthSmile") == half_shapes_of("browInnerUpLeft") == ()
    assert [whole_shape_of(name) for name in ("cheekPuffRight", "mouthSmileLeft", "jawOpen")] == [
        *("cheekPuff", "mouthSmileLeft", "jawOpen")
    ]
    rig = ("jawOpen", "browInnerUpLeft", "browInnerUpRight", "cheekPuff")
    assert makers("browInnerUp", rig) == ("browInnerUpLeft", "browInnerUpRight")
    assert makers("cheekPuffLeft", rig) == makers("cheekPuff", rig) == ("cheekPuff",)
    assert makers("browInnerUpLeft", rig) == ("browInnerUpLeft",)
    assert makers("tongueOut", rig) == makers("mouthSmile", ("mouthSmileLeft", "mouthSmileRight")) == ()


def test_weights_go_from_one_set_of_names_to_another() -> None:
    rig = ("jawOpen", "browInnerUpLeft", "browInnerUpRight", "cheekPuff", "ears")
    to_rig, back = weight_map(rig, ARKIT_SHAPES), weight_map(ARKIT_SHAPES, rig)
    frame = np.zeros(52)
    frame[[ARKIT_SHAPES.index(name) for name in ("jawOpen", "browInnerUp", "cheekPuff")]] = 0.2, 0.6, 0.4
    assert (to_rig @ frame).tolist() == [0.2, 0.6, 0.6, 0.4, 0.0]
    assert (back @ (to_rig @ frame)).tolist() == frame.tolist()
    assert (back @ [0.0, 1.0, 0.0, 0.0, 1.0])[ARKIT_SHAPES.index("browInnerUp")] == 0.5
