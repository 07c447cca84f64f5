"""JSON files are read within bounds, and what is wrong with one is said with the path of its key."""

import json
import os
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest
from msgspec import UNSET, Meta, Struct, UnsetType, field

from faceposer.errors import FacePoserError
from faceposer.files import json_documents
from faceposer.files.json_documents import (
    MAX_DEPTH,
    JsonDocument,
    JsonError,
    JsonObject,
    UnreadableError,
    check_header,
    convert,
    given,
    read_json,
    shown,
)

Coordinate = Annotated[float, Meta(ge=-1000.0, le=1000.0)]
Pixel = Annotated[tuple[Coordinate, Coordinate], Meta(title="pixels [u, v]")]
Word = Annotated[str, Meta(min_length=1, max_length=5)]


class Anchor(JsonObject):
    vertex: Annotated[int, Meta(ge=0, lt=100)]
    locked: bool = False

    def __post_init__(self) -> None:
        if self.vertex == 13:
            raise JsonError("brings bad luck", "vertex")
        if self.vertex == 17 and self.locked:
            raise JsonError("must not be locked")
        if self.vertex == 19:
            raise ValueError("nineteen")


class Notes(Struct):
    author: str = ""


class Face(JsonDocument, kw_only=True):
    anchors: Annotated[list[Annotated[Anchor, Meta(title="anchors")]], Meta(max_length=3)] = field(default_factory=list)
    target: Pixel | UnsetType = UNSET
    way: Annotated[tuple[Pixel, ...], Meta(min_length=2, max_length=4)] | UnsetType = UNSET
    gaps: list[Pixel | None] = field(default_factory=list)
    source: Anchor | tuple[Pixel, ...] | UnsetType = UNSET
    weights: Annotated[dict[str, Coordinate], Meta(max_length=2)] = field(default_factory=dict)
    shape: Literal["line", "closed"] = "line"
    name: Word = "face"
    size: Annotated[int, Meta(ge=1)] | None = None
    share: Annotated[float, Meta(le=1.0)] = 1.0
    eyes: Annotated[str, Meta(min_length=1, description="the colour of the eyes")] = "blue"
    notes: Notes = field(default_factory=Notes)
    rows: list[list[int]] = field(default_factory=list)
    flags: list[bool] = field(default_factory=list)


def face(**changes: Any) -> dict[str, Any]:
    return {"format": "face", "version": 1, **changes}


def test_what_fits_is_converted() -> None:
    form = convert(
        face(anchors=[{"vertex": 3}], target=[1, 2.5], gaps=[None, [0, 0]], source=[[1, 2]], weights={"a": 1}), Face
    )
    assert form.anchors[0].vertex == 3
    assert given(form.target) == (1.0, 2.5)
    assert given(form.way) is None
    assert form.gaps == [None, (0.0, 0.0)]
    assert form.source == ((1.0, 2.0),)
    assert isinstance(form.weights["a"], float)
    assert isinstance(convert(face(source={"vertex": 1}), Face).source, Anchor)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            {"anchors": [{"vertex": 1}, {"vertex": "x"}]},
            "anchors[1].vertex must be a whole number from 0 to 99, not 'x'.",
        ),
        ({"anchors": [{"vertex": 100}]}, "anchors[0].vertex must be a whole number from 0 to 99, not 100."),
        ({"anchors": [{"vertex": 1.0}]}, "anchors[0].vertex must be a whole number from 0 to 99, not 1.0."),
        ({"anchors": [{"vertex": True}]}, "anchors[0].vertex must be a whole number from 0 to 99, not true."),
        ({"anchors": [{"vertex": 10**400}]}, "anchors[0].vertex must be a whole number from 0 to 99, not 1000000"),
        ({"anchors": [{}]}, "anchors[0] lacks the key 'vertex'."),
        ({"anchors": [5]}, "anchors[0] must be an object with the keys 'vertex', not 5."),
        ({"anchors": {}}, "anchors must be a list of at most 3 anchors, not {}."),
        ({"anchors": [{"vertex": 1}] * 4}, "anchors must be a list of at most 3 anchors, not 4."),
        (
            {"anchors": [{"vertex": 1, "colour": 2}]},
            "anchors[0] has the unknown key 'colour'; the keys here are 'locked', 'vertex'.",
        ),
        ({"anchors": [{"vertex": 1, "locked": 1}]}, "anchors[0].locked must be true or false, not 1."),
        ({"anchors": [{"vertex": 13}]}, "anchors[0].vertex brings bad luck."),
        ({"anchors": [{"vertex": 17, "locked": True}]}, "anchors[0] must not be locked."),
        ({"anchors": [{"vertex": 19}]}, "anchors[0]: nineteen."),
        ({"target": [1, float("nan")]}, "target[1] must be a number from -1000 to 1000, not nan."),
        ({"target": [1, float("-inf")]}, "target[1] must be a number from -1000 to 1000, not -inf."),
        ({"target": [1, 10**400]}, "target[1] must be a number from -1000 to 1000, not 1"),
        ({"target": [1, None]}, "target[1] must be a number from -1000 to 1000, not null."),
        ({"target": [True, 1]}, "target[0] must be a number from -1000 to 1000, not true."),
        ({"target": [1]}, "target must be a list of 2 numbers, not 1."),
        ({"target": [1, 2, 3]}, "target must be a list of 2 numbers, not 3."),
        ({"target": None}, "target must be a list of 2 numbers, not null."),
        ({"way": [[1, 2]]}, "way must be a list of 2 to 4 pixels [u, v], not 1."),
        ({"way": [[1, 2], [3]]}, "way[1] must be a list of 2 numbers, not 1."),
        ({"way": "left"}, "way must be a list of 2 to 4 pixels [u, v], not 'left'."),
        ({"gaps": [None, [0, 0], [1]]}, "gaps[2] must be a list of 2 numbers, not 1."),
        ({"source": {"vertex": -1}}, "source.vertex must be a whole number from 0 to 99, not -1."),
        ({"source": [[1, "2"]]}, "source[0][1] must be a number from -1000 to 1000, not '2'."),
        ({"source": 3}, "source must be an object with the keys 'vertex' or a list of pixels [u, v], not 3."),
        ({"weights": {"jaw": 1, "lip": "x"}}, "weights.lip must be a number from -1000 to 1000, not 'x'."),
        ({"weights": [1]}, "weights must be an object of at most 2 numbers, not [1]."),
        ({"weights": dict.fromkeys("abc", 1)}, "weights must be an object of at most 2 numbers, not {'a': 1"),
        ({"shape": "round"}, "shape is 'round'; it must be one of 'line', 'closed'."),
        ({"shape": []}, "shape is []; it must be one of 'line', 'closed'."),
        ({"name": ""}, "name must be a text of 1 to 5 characters, not ''."),
        ({"name": 7}, "name must be a text of 1 to 5 characters, not 7."),
        ({"size": 0}, "size must be a whole number of at least 1, not 0."),
        ({"size": "x"}, "size must be a whole number of at least 1, not 'x'."),
        ({"share": 2}, "share must be a number of at most 1, not 2."),
        ({"eyes": ""}, "eyes must be the colour of the eyes, not ''."),
        ({"notes": {"author": 1, "date": 2}}, "notes.author must be a text, not 1."),
        ({"rows": [[1], [1, "x"]]}, "rows[1][1] must be a whole number, not 'x'."),
        ({"rows": 1}, "rows must be a list of lists, not 1."),
        ({"flags": {}}, "flags must be a list of flags, not {}."),
        ({"colour": 1}, "the file has the unknown key 'colour'; the keys here are 'anchors', 'eyes',"),
        ({"target": {"x" * 1000: 1}}, "target must be a list of 2 numbers, not {'xxxxxxxxxxxx"),
        ({"target": "y" * 1000}, "target must be a list of 2 numbers, not 'yyy"),
        ({"target": "one\ntwo"}, r"target must be a list of 2 numbers, not 'one\ntwo'."),
    ],
)
def test_what_does_not_fit_is_named_by_its_path(change: dict[str, Any], sentence: str) -> None:
    with pytest.raises(FacePoserError) as refused:
        convert(face(**change), Face)
    said = str(refused.value)
    assert said.startswith(sentence)
    assert said.endswith(".")
    assert len(said) < 300
    with pytest.raises(FacePoserError) as refused:
        convert([face(**change)], list[Face], "faces")
    assert str(refused.value) == (said.replace("the file", "faces[0]") if "colour" in change else f"faces[0].{said}")


def test_other_keys_are_let_through_where_the_form_says_so() -> None:
    assert convert({"author": "me", "date": 2}, Notes).author == "me"


def test_every_union_of_alternatives_is_explained() -> None:
    with pytest.raises(FacePoserError, match=r"^size must be a whole number or a text or null, not \[\]\.$"):
        convert([], int | str | None, "size")  # type: ignore[arg-type]


# Files


def parsed(data: Any) -> Any:
    return data


def refused(path: Path, **options: Any) -> str:
    with pytest.raises(FacePoserError) as caught:
        read_json(path, "session", parsed, **options)
    said = str(caught.value)
    assert said.startswith(f"The session '{path}' cannot be read: ")
    assert "\n" not in said
    assert said.endswith(".")
    return said


def test_files_are_utf8_with_or_without_a_byte_order_mark(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    for content in ('{"ä": [1, 2.5, null, true]}'.encode(), '{"ä": [1, 2.5, null, true]}'.encode("utf-8-sig")):
        path.write_bytes(content)
        assert read_json(path, "session", parsed) == {"ä": [1, 2.5, None, True]}


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "not valid JSON at line 1, column 1"),
        (b"{", "not valid JSON at line 1, column 2"),
        (b'{"a": 1,\n "b" 2}', "not valid JSON at line 2, column 6"),
        (b"[1] [2]", "not valid JSON at line 1, column 5"),
        (b"\xff\xfe\x00", "it is not a text file in UTF-8"),
        ('{"a": 1}'.encode("utf-16"), "it is not a text file in UTF-8"),
        (b"[" * 100_000, "nested too deeply"),
        (b"[" * 100_000 + b"]" * 100_000, "nested too deeply"),
        (b'{"a":' * 100_000, "nested too deeply"),
    ],
)
def test_what_is_no_json_is_refused(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(content)
    assert said in refused(path)


def test_depth_is_bounded_before_parsing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.json"
    text = '"]{\\"[\\\\"'
    path.write_text("[" * MAX_DEPTH + text + "]" * MAX_DEPTH)
    data = read_json(path, "session", parsed)
    for _ in range(MAX_DEPTH):
        (data,) = data
    assert data == json.loads(text)
    path.write_text(f'{{"{"[" * 1000}": "{"{" * 1000}"}}')
    assert list(read_json(path, "session", parsed)) == ["[" * 1000]
    monkeypatch.setattr(json_documents.json, "loads", lambda *_, **__: pytest.fail("it is parsed"))
    path.write_text("[" * (MAX_DEPTH + 1) + "]" * (MAX_DEPTH + 1))
    assert "nested too deeply" in refused(path)
    path.write_text('["\\\\", ' + "[" * MAX_DEPTH + "]" * MAX_DEPTH + "]")
    assert "nested too deeply" in refused(path)


def test_size_is_bounded_before_reading(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.json"
    path.write_text('"' + "x" * 98 + '"')
    assert len(read_json(path, "session", parsed, 100)) == 98
    with path.open("wb") as file:
        file.truncate(2**40)
    monkeypatch.setattr(os, "open", lambda *_: pytest.fail("it is opened"))
    assert "it is larger than 64 MB" in refused(path, max_bytes=64 * 2**20)


def test_numbers_that_json_does_not_have_are_refused_with_their_place(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    for number, name in (
        ("NaN", "NaN"),
        ("Infinity", "Infinity"),
        ("-Infinity", "-Infinity"),
        ("1e999", "1e999"),
        ("1" * 5000, "1" * 24),
    ):
        path.write_text(f'{{"format": "face", "version": 1, "target": [1, {number}]}}')
        with pytest.raises(FacePoserError, match=rf"cannot be used: target\[1\] must be a number .*, not {name}"):
            read_json(path, "session", lambda data: convert(data, Face))
    path.write_text("[NaN]")
    with pytest.raises(FacePoserError, match=r"\[0\] must be a number, not NaN"):
        read_json(path, "session", lambda data: convert(data, list[float]))


def test_memory_is_bounded_before_parsing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.json"
    monkeypatch.setattr(json_documents, "_MAX_MEMORY", 2**20)
    for content in ("[" + "[]," * 20_000 + "[]]", "[" + "{}," * 6_000 + "{}]", '["' + '","' * 20_000 + '"]'):
        path.write_text(content)
        assert "its values would take" in refused(path)
    path.write_text("[" + "0," * 20_000 + "0]")
    assert len(read_json(path, "session", parsed)) == 20_001


def test_texts_that_cannot_be_encoded_have_a_place(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    head = '"format": "face", "version": 1'
    for content, said in (
        (f'{{{head}, "shape": "a\\ud800"}}', r"shape is 'a\ud800'; it must be one of 'line', 'closed'."),
        (f'{{{head}, "a\\ud800": 1}}', r"the file has the unknown key 'a\ud800'; the keys here are 'anchors'"),
        (
            f'{{{head}, "weights": {{"a\\ud800": "x"}}}}',
            r"weights.a\ud800 must be a number from -1000 to 1000, not 'x'.",
        ),
        (f'{{{head}, "anchors": [{{"a\\udfff": 1}}]}}', r"anchors[0] has the unknown key 'a\udfff'; the keys here are"),
    ):
        path.write_text(content)
        with pytest.raises(FacePoserError) as caught:
            read_json(path, "face", lambda data: convert(data, Face))
        assert said in str(caught.value)
        assert str(caught.value).isprintable()


def test_keys_that_are_there_twice_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text('{"a": {"b": 1, "c": 2, "b": 3}}')
    assert 'the key "b" occurs twice' in refused(path)
    assert json_documents.parse_json(path.read_bytes()) == {"a": {"b": 3, "c": 2}}


def test_only_regular_files_are_read(tmp_path: Path) -> None:
    assert "it is a folder" in refused(tmp_path)
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe")
        assert "it is a pipe, not a file" in refused(tmp_path / "pipe")
    path = tmp_path / "a.json"
    path.write_text("[]")
    (tmp_path / "link").symlink_to(path)
    assert read_json(tmp_path / "link", "session", parsed) == []


def test_what_the_system_refuses_has_an_error_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for path in (tmp_path / "none.json", tmp_path / "no" / "a.json", tmp_path / ("n" * 300)):
        with pytest.raises(UnreadableError, match=r"The session '.*' cannot be read: "):
            read_json(path, "session", parsed)
    path = tmp_path / "a.json"
    path.write_text("[]")

    def denied(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    with monkeypatch.context() as patch:
        patch.setattr(os, "open", denied)
        with pytest.raises(UnreadableError, match=r"cannot be read: Permission denied\.$"):
            read_json(path, "session", parsed)
    path.write_text("[")
    with pytest.raises(FacePoserError) as caught:
        read_json(path, "session", parsed)
    assert not isinstance(caught.value, UnreadableError)


def test_what_the_content_lacks_is_said_with_the_file(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    for data, said in (
        ([], 'the file has no "format": "face".'),
        ({"format": "else", "version": 1}, 'the file has no "format": "face".'),
        ({"format": "face"}, "version is null; this program reads version 1."),
        ({"format": "face", "version": 2}, "version is 2; this program reads version 1."),
        ({"format": "face", "version": True}, "version is true; this program reads version 1."),
        ({"format": "face", "version": "1"}, "version is '1'; this program reads version 1."),
    ):
        path.write_text(json.dumps(data))
        with pytest.raises(FacePoserError) as caught:
            read_json(path, "face", lambda data: check_header(data, "face", 1))
        assert str(caught.value) == f"The face '{path}' cannot be used: {said}"


def test_values_are_shown_short() -> None:
    assert [shown(value) for value in (None, True, 1, "a", [1, "b"])] == ["null", "true", "1", "'a'", "[1, 'b']"]
    deep: list[Any] = []
    for _ in range(100_000):
        deep = [deep]
    for value in ("x" * 1000, list(range(1000)), dict.fromkeys(range(100), "y" * 100), deep, 10**300):
        assert len(shown(value)) <= 40
