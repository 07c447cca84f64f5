"""Files of strokes are read as written, and wrong ones are refused in one sentence that names the place."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import OrbitView
from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel
from faceposer.model.framing import face_view
from faceposer.sketch.strokes_file import read_strokes, strokes_from_json
from faceposer.solve.constraints import codec

VIEW = {"view": "front", "size": [640, 480]}
STROKES: list[dict[str, Any]] = [
    {"pixels": [[1, 2], [3.5, 4], [5, 6]], "feature": None},
    {"pixels": [[7, 8], [9, 10]], "feature": "left brow"},
    {"pixels": [[7, 8], [9, 11]]},
]
DATA: dict[str, Any] = {"format": "faceposer.strokes", "version": 1, "camera": VIEW, "strokes": STROKES}


@pytest.fixture(scope="module")
def character(low: FaceModel) -> Character:
    return low.character


def front(character: Character, size: tuple[int, int] = (640, 480)) -> Any:
    return OrbitView.preset(character.vertices.min(axis=0), character.vertices.max(axis=0)).camera(size)


def test_strokes_are_read_with_their_camera(character: Character, tmp_path: Path) -> None:
    path = tmp_path / "strokes.json"
    path.write_text(json.dumps(DATA))
    strokes = read_strokes(path, character)
    np.testing.assert_array_equal(strokes[0].pixels, STROKES[0]["pixels"])
    assert [stroke.feature for stroke in strokes] == [None, "left brow", None]
    # The same framing as of ``Face.camera``: the face, not the whole head.
    (width, height), view = DATA["camera"]["size"], DATA["camera"]["view"]
    expected = face_view(character, view, width / height).camera((width, height))
    assert all(stroke.camera == expected for stroke in strokes)


def test_cameras_are_views_parameters_or_given_separately(character: Character) -> None:
    camera = front(character, (320, 200))
    written = DATA | {"camera": json.loads(json.dumps(codec.camera_to_json(camera)))}
    assert strokes_from_json(written, character)[0].camera == camera
    assert strokes_from_json(DATA, character, camera)[0].camera == camera
    without = {key: value for key, value in DATA.items() if key != "camera"}
    assert strokes_from_json(without, character, camera)[0].camera == camera
    with pytest.raises(FacePoserError, match="lacks the key 'camera'"):
        strokes_from_json(without, character)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"format": "faceposer.session"}, 'has no "format": "faceposer.strokes"'),
        ({"version": 2}, "version is 2; this program reads version 1"),
        ({"colour": 1}, "the file has the unknown key 'colour'"),
        ({"camera": {"view": "nose", "size": [1, 1]}}, r"camera\.view is 'nose'"),
        ({"strokes": []}, "strokes must be a list of 1 to 200 strokes"),
        ({"strokes": [STROKES[2]] * 201}, "strokes must be a list of 1 to 200 strokes, not 201"),
        ({"strokes": [{"pixels": [[1, 2]]}]}, r"strokes\[0\]\.pixels must be a list of 2 to 10000 pixels"),
        ({"strokes": [{"pixels": [[1, 2]] * 10_001}]}, r"strokes\[0\]\.pixels must be a list of 2 to 10000 pixels"),
        ({"strokes": [STROKES[0], {"pixels": [[1, 2], [3, 1e7]]}]}, r"strokes\[1\]\.pixels\[1\]\[1\] must be a number"),
        ({"strokes": [{"pixels": [[1, 2], [3, "4"]]}]}, r"strokes\[0\]\.pixels\[1\]\[1\] must be a number"),
        (
            {"strokes": [STROKES[1] | {"feature": "brow"}]},
            r"feature must be null or the name of a feature",
        ),
        ({"strokes": [STROKES[1] | {"feature": 3}]}, r"strokes\[0\]\.feature must be"),
        ({"strokes": [STROKES[1] | {"width": 3}]}, r"strokes\[0\] has the unknown key 'width'"),
    ],
)
def test_wrong_files_are_refused_with_the_place(
    character: Character, tmp_path: Path, change: dict[str, Any], said: str
) -> None:
    path = tmp_path / "strokes.json"
    path.write_text(json.dumps(DATA | change))
    with pytest.raises(FacePoserError, match=said) as refused:
        read_strokes(path, character)
    assert str(path) in str(refused.value)


def test_numbers_that_are_not_finite_are_refused(character: Character, tmp_path: Path) -> None:
    path = tmp_path / "strokes.json"
    path.write_text(json.dumps(DATA).replace("3.5", "NaN"))
    with pytest.raises(FacePoserError, match=r"strokes\[0\]\.pixels\[1\]\[0\] must be a number"):
        read_strokes(path, character)


def test_files_of_another_kind_are_named(character: Character, tmp_path: Path) -> None:
    with pytest.raises(FacePoserError, match=r"must be a file that ends in '\.json'"):
        read_strokes(tmp_path / "strokes.txt", character)
    with pytest.raises(FacePoserError, match="cannot be read: No such file"):
        read_strokes(tmp_path / "strokes.json", character)


def test_a_feature_that_the_character_lacks_is_named(character: Character) -> None:
    points = {name: vertex for name, vertex in character.feature_points.items() if name != "4.3"}
    titles = {name: title for name, title in character.feature_titles.items() if name in points}
    browless = replace(character, feature_points=points, feature_titles=titles)
    with pytest.raises(FacePoserError, match=r"strokes\[1\]\.feature is 'left brow', but .* lacks .* 4\.3\."):
        strokes_from_json(DATA, browless)
