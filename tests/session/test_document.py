"""Session files come back as they were written, and wrong ones are refused with their place."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
import pytest
from msgspec import Meta

from faceposer.errors import FacePoserError
from faceposer.files.json_documents import convert
from faceposer.geometry.camera import Camera, OrbitView
from faceposer.geometry.picking import SurfacePoint
from faceposer.model.character_file import load_character, save_character
from faceposer.model.face_model import FaceModel
from faceposer.session.document import Document, read_document, write_document
from faceposer.session.opening import open_session
from faceposer.solve.constraints import registry
from faceposer.solve.constraints.base import ConstraintJson
from faceposer.solve.constraints.gaze import GazeConstraint
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.problem import SPREAD

CAMERA = OrbitView((0.0, 1.0, 2.0), 0.3, 0.2).camera((640, 480))


def document() -> Document:
    return Document(
        "man",
        (
            PointConstraint(77, (10.5, 20.25), CAMERA),
            PointConstraint(SurfacePoint(5, (0.2, 0.3, 0.5)), (1.0, 2.0), CAMERA, weight=0.5, enabled=False),
        ),
        prior_weight=0.25,
        camera=CAMERA,
    ).posed(np.linspace(-1, 1, 7))


def test_round_trip(tmp_path: Path) -> None:
    path = tmp_path / "smile.json"
    write_document(path, document())
    again = read_document(path)
    assert again.same_input(document())
    assert again.camera == CAMERA
    assert again.coefficients is not None
    np.testing.assert_array_equal(again.coefficients, document().coefficients)
    assert [p.name for p in tmp_path.iterdir()] == ["smile.json"], "no temporary file is left"


def test_the_prior_is_kept_in_the_file(tmp_path: Path) -> None:
    write_document(tmp_path / "a.json", Document("man", prior="whole"))
    assert json.loads((tmp_path / "a.json").read_text())["prior"] == "whole"
    assert read_document(tmp_path / "a.json").prior == "whole"
    write_document(tmp_path / "a.json", Document("man"))
    assert "prior" not in json.loads((tmp_path / "a.json").read_text())
    assert not Document("man").same_input(Document("man", prior="whole"))


def test_the_spread_is_kept_in_the_file(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    for spread in (0.0, 0.3, 1.0):
        write_document(path, Document("man", spread=spread))
        assert json.loads(path.read_text())["spread"] == spread
        assert read_document(path).spread == spread
    write_document(path, Document("man"))
    assert "spread" not in json.loads(path.read_text())
    assert read_document(path).spread == SPREAD
    assert not Document("man").same_input(Document("man", spread=0.3))
    for wrong in (-0.1, 1.1, "much", None):
        path.write_text(json.dumps(Document("man").to_json() | {"spread": wrong}))
        with pytest.raises(FacePoserError, match="spread must be a number"):
            read_document(path)


def test_file_is_as_documented(tmp_path: Path) -> None:
    write_document(tmp_path / "a.json", document())
    data = json.loads((tmp_path / "a.json").read_text())
    assert set(data) == {"format", "version", "subject", "prior_weight", "constraints", "coefficients", "camera"}
    assert data["format"] == "faceposer.session"
    assert data["version"] == 1
    assert data["constraints"][0]["anchor"] == {"vertex": 77}
    assert data["constraints"][1]["anchor"] == {"face": 5, "barycentric": [0.2, 0.3, 0.5]}


def test_the_least_file_is_enough(tmp_path: Path) -> None:
    path = tmp_path / "least.json"
    path.write_text('{"format": "faceposer.session", "version": 1, "subject": "woman", "constraints": []}')
    read = read_document(path)
    assert (read.character, read.constraints, read.prior_weight, read.coefficients) == ("woman", (), 1.0, None)


def test_a_pose_without_constraints_is_where_editing_starts(tmp_path: Path) -> None:
    path = tmp_path / "pose.json"
    write_document(path, Document("man").posed([1.0, 2.0]))
    read = read_document(path)
    assert read.start is not None
    np.testing.assert_array_equal(read.start, [1.0, 2.0])


class SquintJson(ConstraintJson, kw_only=True):
    strength: Annotated[float, Meta(ge=0.0, le=1.0)]


@dataclass(frozen=True)
class Squint(GazeConstraint):
    """A kind of constraint that a plug-in might bring."""

    kind: ClassVar[str] = "squint"
    strength: float = 1.0

    def to_json(self) -> dict[str, Any]:
        return {"type": self.kind, "strength": self.strength, **self.switches_to_json()}

    @classmethod
    def from_json(cls, data: dict[str, Any], where: str) -> "Squint":
        form = convert(data, SquintJson, where)
        return cls(strength=form.strength, **form.switches)


def test_a_kind_that_is_registered_is_read_and_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.json"
    squint = Squint(strength=0.25, weight=2.0, locked=True)
    with pytest.raises(FacePoserError, match=r"was not written, .* constraints\[0\]\.type is 'squint'"):
        write_document(path, Document("man", (squint,)))
    assert not path.exists()
    path.write_text(json.dumps(Document("man", (squint,)).to_json()))
    with pytest.raises(FacePoserError, match=r"constraints\[0\]\.type is 'squint'; the types are 'point', "):
        read_document(path)
    monkeypatch.setattr(registry, "CONSTRAINTS", dict(registry.CONSTRAINTS))
    registry.register(Squint)
    assert read_document(path).constraints == (squint,)
    data = json.loads(path.read_text())
    for change, said in (
        ({"strength": 2}, r"constraints\[0\]\.strength must be a number from 0 to 1, not 2"),
        ({"colour": 2}, r"constraints\[0\] has the unknown key 'colour'; the keys here are 'enabled', 'locked', "),
        ({"locked": 1}, r"constraints\[0\]\.locked must be true or false, not 1"),
    ):
        path.write_text(json.dumps(data | {"constraints": [data["constraints"][0] | change]}))
        with pytest.raises(FacePoserError, match=said):
            read_document(path)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"format": "other"}, 'no "format": "faceposer.session"'),
        ({"version": 9}, "version is 9"),
        ({"subjekt": 1}, "unknown key 'subjekt'"),
        ({"subject": 5}, "subject must be"),
        ({"subject": ""}, "subject must be"),
        ({"prior_weight": -1}, "prior_weight must be a number from 0"),
        ({"prior": "half"}, "prior is .*half"),
        ({"prior": []}, "prior is"),
        ({"prior_weight": "1"}, "prior_weight must be a number"),
        ({"prior_weight": float("nan")}, "prior_weight must be a number"),
        ({"constraints": {}}, "constraints must be a list"),
        ({"constraints": [{"type": "point"}]}, r"constraints\[0\] lacks the key 'anchor'"),
        ({"constraints": [3]}, r"constraints\[0\] must be an object"),
        ({"coefficients": "x"}, "coefficients must be a list"),
        ({"coefficients": [1, None]}, r"coefficients\[1\] must be a number"),
        ({"camera": []}, "camera must be an object"),
    ],
)
def test_wrong_content_is_refused(tmp_path: Path, change: dict, said: str) -> None:
    path = tmp_path / "wrong.json"
    path.write_text(json.dumps(document().to_json() | change))
    with pytest.raises(FacePoserError, match=said) as caught:
        read_document(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"{", "not valid JSON at line 1"),
        (b"", "not valid JSON at line 1"),
        (b"\xff\xfe\x00", "not a text file"),
        (b"[" * 100_000, "nested too deeply|not valid JSON"),
        (b"[]", 'no "format": "faceposer.session"'),
    ],
)
def test_what_is_no_json_is_refused(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "broken.json"
    path.write_bytes(content)
    with pytest.raises(FacePoserError, match=said):
        read_document(path)


def test_missing_files_and_folders_are_named(tmp_path: Path) -> None:
    with pytest.raises(FacePoserError, match=r"nowhere\.json' cannot be read: No such file"):
        read_document(tmp_path / "nowhere.json")
    with pytest.raises(FacePoserError, match="cannot be written: No such file"):
        write_document(tmp_path / "no" / "folder.json", document())


def test_a_failed_write_keeps_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "folder"
    path.mkdir()
    with pytest.raises(FacePoserError, match="cannot be written"):
        write_document(path, document())
    assert path.is_dir()
    assert list(tmp_path.iterdir()) == [path]


def test_documents_are_checked_against_their_face(model: FaceModel) -> None:
    camera: Camera = CAMERA
    with pytest.raises(FacePoserError, match=r"constraints\[0\]: vertex 9999999 belongs to no triangle"):
        Document("man", (PointConstraint(9999999, (0.0, 0.0), camera),)).resolved(model)
    with pytest.raises(FacePoserError, match="triangle 9999999 does not exist"):
        Document("man", (PointConstraint(SurfacePoint(9999999, (1.0, 0.0, 0.0)), (0.0, 0.0), camera),)).resolved(model)
    with pytest.raises(FacePoserError, match="coefficients has 2 numbers"):
        Document("man").posed([1.0, 2.0]).resolved(model)


@pytest.mark.parametrize(
    ("place", "written"),
    [
        ("", "heads/hero.npz"),
        ("heads", "hero.npz"),
        ("poses", "../heads/hero.npz"),
        ("poses/new", None),
        ("../other/deep", None),
    ],
)
def test_a_session_finds_its_character_wherever_it_is_saved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str, written: str | None
) -> None:
    work = tmp_path / "work"
    (work / "heads").mkdir(parents=True)
    folder = work / place
    folder.mkdir(parents=True, exist_ok=True)
    save_character(work / "heads" / "hero.npz", load_character("man"))
    monkeypatch.chdir(work)
    for name in ("heads/hero.npz", str(work / "heads" / "hero.npz")):
        session = open_session(name)
        session.save(folder / "pose.json")
        assert not session.dirty
        character = json.loads((folder / "pose.json").read_text())["subject"]
        assert character == (str(work / "heads" / "hero.npz") if written is None else written)
    monkeypatch.chdir(tmp_path)
    again = open_session(str(folder / "pose.json"))
    assert again.model.character.name == "man"
    again.save(tmp_path / "moved.json")
    assert open_session(str(tmp_path / "moved.json")).document.character == str(work / "heads" / "hero.npz")


def test_a_character_written_anew_is_loaded_anew(tmp_path: Path) -> None:
    path = tmp_path / "hero.npz"
    save_character(path, load_character("man"))
    first = open_session(str(path)).model
    assert open_session(str(path)).model is first
    save_character(path, replace(load_character("man"), title="Another"))
    assert open_session(str(path)).model.character.title == "Another"
