"""JSON of other tools is read where it is clear which weights are meant, and refused where it is not."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.interchange.reading import read_performance
from faceposer.model.face_model import FaceModel
from faceposer.training.weights_file import read_weights

JAW = [round(i / 20, 3) for i in range(20)]
NAMES = ["eyeBlinkLeft", "jawOpen", "somethingElse", "mouth_close"]
ROWS = [[0.0, jaw, 0.7, 0.1] for jaw in JAW]


def by_name(jaw: float) -> dict[str, float]:
    return {"EyeBlink_L": 0.0, "jawOpen": jaw, "headYaw": 0.3}


def categories(jaw: float) -> list[dict[str, Any]]:
    named = [("_neutral", 0.001), ("eyeBlinkLeft", 0.0), ("jawOpen", jaw)]
    return [{"index": i, "score": s, "categoryName": n, "displayName": ""} for i, (n, s) in enumerate(named)]


FORMS: dict[str, Any] = {
    "objects": [by_name(jaw) for jaw in JAW],
    "objects in frames": {"fps": 25, "frames": [{"blendShapes": by_name(jaw), "head": [0, 0, 1]} for jaw in JAW]},
    "times in seconds": {"frames": [{"time": 0.04 * i, "blendShapes": by_name(jaw)} for i, jaw in enumerate(JAW)]},
    "times in milliseconds": [{"timestamp_ms": 40 * i, "weights": by_name(jaw)} for i, jaw in enumerate(JAW)],
    "named weights": [[{"name": k, "weight": v} for k, v in by_name(jaw).items()] for jaw in JAW],
    "pairs": [[[k, v] for k, v in by_name(jaw).items()] for jaw in JAW],
    "categories": [{"timestamp_ms": 40 * i, "faceBlendshapes": [categories(jaw)]} for i, jaw in enumerate(JAW)],
    "categories of faces": [{"t": 0.04 * i, "faces": [{"categories": categories(j)}]} for i, j in enumerate(JAW)],
    "array with names": {"exportFps": 25, "numPoses": 4, "numFrames": 20, "facsNames": NAMES, "weightMat": ROWS},
    "array over time": {"fps": 25, "names": NAMES, "weights": np.transpose(ROWS).tolist()},
    "arrays in frames": {"names": NAMES, "frames": [{"t": 0.04 * i, "values": row} for i, row in enumerate(ROWS)]},
    "lists by name": {"time": [0.04 * i for i in range(20)], "jawOpen": JAW, "mouthClose": [0] * 20},
    "named lists": {"frameRate": 25, "curves": [{"name": "jawOpen", "values": JAW}]},
    "deep": {"take": {"fps": 25, "data": {"frames": [{"face": by_name(jaw)} for jaw in JAW]}}},
    "curves of keys": {
        "curves": [{"name": "JawOpen", "keys": [{"time": 0.04 * i, "value": jaw} for i, jaw in enumerate(JAW)]}]
    },
    "curves by name": {"jawOpen": [{"t": 0.04 * i, "v": jaw} for i, jaw in enumerate(JAW)], "mouthClose": []},
    "curves of lists": {
        "tracks": [{"name": "mouthClose", "times": [0.0, 0.76], "values": [0.0, 1.0]}]
        + [{"name": "jawOpen", "times": [0.04 * i for i in range(20)], "values": JAW}]
    },
    "curves at frames": {"fps": 25, "jawOpen": {"keys": [{"frame": i, "value": jaw} for i, jaw in enumerate(JAW)]}},
    "percent": {"fps": 25, "frames": [{"jawOpen": 100 * jaw} for jaw in JAW]},
}


def write(path: Path, data: Any) -> Path:
    path.write_text(json.dumps(data))
    return path


@pytest.mark.parametrize("form", list(FORMS))
def test_forms_that_are_clear_are_read(form: str, tmp_path: Path) -> None:
    read = read_weights(write(tmp_path / "a.json", FORMS[form]))
    (column,) = [i for i, name in enumerate(read.names) if name.lower() == "jawopen"]
    np.testing.assert_allclose(read.frames[:, column], JAW, atol=1e-9)
    assert read.rate == (30.0 if form in ("objects", "named weights", "pairs") else 25.0)
    assert ("assumed" in " ".join(read.notes)) == (read.rate == 30.0)
    assert ("percentages" in " ".join(read.notes)) == (form == "percent")
    assert read_weights(tmp_path / "a.json", 50.0).rate == 50.0


def test_two_spellings_with_different_weights_are_refused(low: FaceModel, tmp_path: Path) -> None:
    for data in ({"jawOpen": 0.5, "JawOpen": 0.4}, [["eyeBlink_L", 1.0], ["eyeBlinkLeft", 0.0]]):
        with pytest.raises(FacePoserError, match="twice"):
            read_performance(write(tmp_path / "a.json", data), low)


def test_a_pose_is_one_frame(low: FaceModel, tmp_path: Path) -> None:
    for data in (by_name(0.5), [{"name": "jawOpen", "value": 0.5}], {"names": NAMES, "weights": ROWS[10]}):
        read = read_weights(write(tmp_path / "a.json", data))
        assert read.frames[:, read.names.index("jawOpen")].tolist() == [0.5]
        assert (read.rate, read.notes) == (None, ())
        assert len(read_performance(tmp_path / "a.json", low).performance) == 1


@pytest.mark.parametrize("empty", [None, {}, [], {"time": 0.2, "blendShapes": None}, {"faceBlendshapes": [[]]}])
def test_frames_without_a_face_are_interpolated_and_said(empty: Any, tmp_path: Path) -> None:
    frames = [{"time": 0.04 * i, "blendShapes": by_name(jaw)} for i, jaw in enumerate(JAW)]
    frames[5:8] = [empty] * 3
    read = read_weights(write(tmp_path / "a.json", {"fps": 25, "frames": frames}))
    np.testing.assert_allclose(read.frames[:, read.names.index("jawOpen")], JAW, atol=1e-6)
    assert "3 of its 20 frames have no face" in " ".join(read.notes)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ({"a": FORMS["objects"], "b": FORMS["objects"]}, "in several places, 'a' and 'b'"),
        ([{"jawOpen": 7.0}, {"jawOpen": 1e9}], "which is neither of 0 to 1 nor of 0 to 100"),
        ({"a": [1, 2, {"b": 3}]}, 'no "format"'),
        ([], 'no "format"'),
        ([[[[[[[[[[[[{"jawOpen": 1}]]]]]]]]]]]], 'no "format"'),
        ({"jawOpen": True}, "jawOpen must be a number, not true"),
        ({"jawOpen": [0, 1], "mouthClose": [1]}, 'no "format"'),
        ({"format": "faceposer.session", "jawOpen": 1}, 'no "format"'),
    ],
)
def test_what_is_not_clear_gets_one_sentence(data: Any, said: str, tmp_path: Path) -> None:
    with pytest.raises(FacePoserError, match=said) as error:
        read_weights(write(tmp_path / "a.json", data))
    assert str(tmp_path / "a.json") in str(error.value)


def test_curves_with_keys_of_their_own_are_interpolated(tmp_path: Path) -> None:
    curves = [
        {"name": "jawOpen", "keys": [{"time": 0.0, "value": 0.0}, {"time": 2.0, "value": 1.0}]},
        {"name": "mouthClose", "keys": [{"time": 1.0, "value": 0.5}]},
    ]
    read = read_weights(write(tmp_path / "a.json", {"curves": curves}))
    assert read.rate == 30.0
    assert "Its keys are 1 s apart; they were interpolated at 30 frames per second." in read.notes
    np.testing.assert_allclose(read.frames[:, 0], np.arange(61) / 60.0, atol=1e-9)
    np.testing.assert_allclose(read.frames[:, 1], 0.5)
    assert len(read_weights(tmp_path / "a.json", 10.0).frames) == 21
    curves[0]["keys"][1]["time"] = 1e9  # type: ignore[index]
    with pytest.raises(FacePoserError, match="its keys span more than 250,000 frames"):
        read_weights(write(tmp_path / "a.json", {"curves": curves}))


@pytest.mark.parametrize("affixes", [("A01_", ""), ("", "_Head_Mesh"), ("mesh.morphTargetInfluences[", "]")])
def test_names_with_affixes_are_read_and_told(affixes: tuple[str, str], tmp_path: Path) -> None:
    names = ["jawOpen", "eyeBlinkLeft", "eyeBlinkRight", "mouthFunnel", "mouthPucker", "browInnerUp"]
    frames = [{affixes[0] + name + affixes[1]: 0.1 * i + 0.01 * k for k, name in enumerate(names)} for i in range(5)]
    read = read_weights(write(tmp_path / "a.json", {"fps": 25, "frames": frames}))
    assert list(read.names) == names
    np.testing.assert_allclose(read.frames[:, 0], 0.1 * np.arange(5))
    assert any("are read without their" in note for note in read.notes)


def test_the_forms_that_are_read_are_listed_where_none_is_found(tmp_path: Path) -> None:
    with pytest.raises(FacePoserError, match="numbers by name in each frame, named weights, rows with a list of names"):
        read_weights(write(tmp_path / "a.json", {"curves": [{"name": "jawOpen", "handles": [[0, 1]]}]}))


def test_curves_at_times_and_at_frames_are_not_mixed(tmp_path: Path) -> None:
    curves = [
        {"name": "jawOpen", "keys": [{"time": 0.0, "value": 0.0}]},
        {"name": "mouthClose", "keys": [{"frame": 1, "value": 0.5}]},
    ]
    with pytest.raises(FacePoserError, match="some of its curves have keys at times and some at frames"):
        read_weights(write(tmp_path / "a.json", curves))


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ('[{"jawOpen": NaN, "mouthClose": 0.2}, {"jawOpen": 0.5}]', "[0].jawOpen must be a number, not NaN"),
        ('[{"jawOpen": 0.1}, {"jawOpen": 1e400, "mouthClose": 0}]', "[1].jawOpen must be a number, not 1e400"),
        ('{"frames": [{"jawOpen": null, "mouthClose": 0.2}]}', "frames[0].jawOpen must be a number, not null"),
        ('[{"jawOpen": "n/a", "mouthClose": 0.2}]', "[0].jawOpen must be a number, not 'n/a'"),
        ('[{"name": "jawOpen", "value": NaN}, {"name": "mouthClose", "value": 1}]', "[0].value must be a number"),
        ('[["jawOpen", -Infinity], ["mouthClose", 1]]', "[0][1] must be a number, not -Infinity"),
        ('{"jawOpen": [0, NaN, 1], "mouthClose": [0, 0, 0]}', "jawOpen[1] must be a number, not NaN"),
        (
            '{"names": ["jawOpen", "mouthClose", "jawLeft"], "rows": [[0, 1, 0], [0, null, 1]]}',
            "rows[1][1] must be a number, not null",
        ),
        ('[{"jawOpen": 0.1, "jawOpen": 0.5}]', 'the key "jawOpen" occurs twice'),
        ('[{"jawOpen": 0.1}] 5', "(more text follows the end)"),
    ],
)
def test_values_that_are_no_weights_are_refused_by_place(text: str, place: str, tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(FacePoserError, match=re.escape(place)):
        read_weights(tmp_path / "a.json")


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-8-sig"])
def test_encodings_are_those_of_tables(encoding: str, tmp_path: Path) -> None:
    (tmp_path / "a.json").write_bytes(json.dumps(FORMS["objects"]).encode(encoding))
    assert len(read_weights(tmp_path / "a.json").frames) == len(JAW)


def test_lines_of_json_are_frames(tmp_path: Path) -> None:
    lines = [json.dumps({"time": 0.04 * i, "jawOpen": jaw}) for i, jaw in enumerate(JAW)]
    (tmp_path / "a.json").write_text("\n".join(lines) + "\n\n")
    read = read_weights(tmp_path / "a.json")
    assert read.rate == 25.0
    np.testing.assert_allclose(read.frames[:, 0], JAW)


@pytest.mark.parametrize(
    ("value", "rate"),
    [("24", 24.0), ("30000/1001", 30000 / 1001), ({"num": 30000, "den": 1001}, 30000 / 1001), (50, 50.0)],
)
def test_rates_are_numbers_texts_and_fractions(value: Any, rate: float, tmp_path: Path) -> None:
    data = {"fps": value, "frames": [{"jawOpen": jaw} for jaw in JAW]}
    read = read_weights(write(tmp_path / "a.json", data))
    assert (read.rate, read.notes) == (pytest.approx(rate), ())


def test_what_is_left_out_is_told(tmp_path: Path) -> None:
    frames = [{"jawOpen": jaw} for jaw in JAW]
    data: Any = {"meta": {"rest": {"jawOpen": 0.02}}, "fps": 25, "frames": frames}
    read = read_weights(write(tmp_path / "a.json", data))
    assert read.notes == ("A pose outside of its frames, at 'meta.rest', was not read.",)
    both = {"fps": 25, "frames": [{"faces": [{"jawOpen": jaw}, {"jawOpen": 0.9}]} for jaw in JAW]}
    read = read_weights(write(tmp_path / "a.json", both))
    np.testing.assert_allclose(read.frames[:, 0], JAW)
    assert read.notes == ("It has up to 2 faces in a frame; the first of each frame was read.",)


@pytest.mark.parametrize("turned", [False, True])
def test_square_matrices_are_read_by_their_smoothness(turned: bool, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    names = ["jawOpen", "mouthClose", "jawLeft", "jawRight", "mouthFunnel", "mouthPucker", "cheekPuff", "noseSneerLeft"]
    weights = rng.uniform(0.2, 0.8, 8) + 0.02 * np.arange(8)[:, None]
    rows = weights.T if turned else weights
    read = read_weights(write(tmp_path / "a.json", {"fps": 25, "names": names, "weightMat": rows.tolist()}))
    np.testing.assert_allclose(read.frames, weights)
    kind = "shape" if turned else "frame"
    assert f"may be for frames or for shapes; each was read as a {kind}" in read.notes[0]
