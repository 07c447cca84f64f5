"""Lists of pairs in files."""

import json
from pathlib import Path
from typing import Any

import pytest

from faceposer.errors import FacePoserError
from faceposer.model.character_file import available_characters, load_character
from faceposer.transfer.pairs import DEFAULT_PAIRS, PAPER_PAIRS, Pair, pairs_from_json, pairs_to_json, read_pairs


def test_every_shipped_face_has_all_points_and_each_pair_has_a_name_of_its_own() -> None:
    assert len({pair.name for pair in DEFAULT_PAIRS}) == len(DEFAULT_PAIRS)
    assert set(PAPER_PAIRS) < set(DEFAULT_PAIRS)
    for name, _ in available_characters():
        character = load_character(name)
        assert all(pair.measurable(character) for pair in DEFAULT_PAIRS)


def test_a_list_comes_back_from_its_file(tmp_path: Path) -> None:
    pairs = (*DEFAULT_PAIRS, Pair("mine", "2.1", "9.3", weight=0.5), Pair("off", "2.1", "9.2", enabled=False))
    path = tmp_path / "pairs.json"
    path.write_text(json.dumps(pairs_to_json(pairs)))
    assert read_pairs(path) == pairs


def test_a_name_may_be_left_out() -> None:
    data = {"format": "faceposer.pairs", "version": 1, "pairs": [{"points": ["8.3", "8.4"]}]}
    assert pairs_from_json(data) == (Pair("8.3 to 8.4", "8.3", "8.4"),)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"format": "other"}, 'no "format"'),
        ({"version": 2}, "version is 2"),
        ({"pairs": []}, "pairs must be a list of 1 to"),
        ({"pairs": [{"points": ["8.3"]}]}, r"pairs\[0\].points must be"),
        ({"pairs": [{"points": ["8.3", "8.3"]}]}, "twice"),
        ({"pairs": [{"points": ["8.3", "8.4"], "weight": -1}]}, r"pairs\[0\].weight must be"),
        ({"pairs": [{"points": ["8.3", "8.4"], "name": ""}]}, r"pairs\[0\].name must be"),
        ({"pairs": [{"points": ["8.3", "8.4"], "wieght": 1}]}, "unknown key 'wieght'"),
        ({"more": 1}, "unknown key 'more'"),
    ],
)
def test_what_is_wrong_with_a_file_is_said_with_its_place(tmp_path: Path, change: dict[str, Any], said: str) -> None:
    path = tmp_path / "pairs.json"
    path.write_text(json.dumps(pairs_to_json(PAPER_PAIRS) | change))
    with pytest.raises(FacePoserError, match=said) as caught:
        read_pairs(path)
    assert str(path) in str(caught.value)


def test_files_that_are_no_json_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "pairs.json"
    with pytest.raises(FacePoserError, match="cannot be read"):
        read_pairs(path)
    path.write_text('{"format":')
    with pytest.raises(FacePoserError, match="line 1"):
        read_pairs(path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FacePoserError, match="not a text file"):
        read_pairs(path)
