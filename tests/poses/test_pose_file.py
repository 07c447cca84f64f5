"""Pose files come back as they were written; a library keeps, renames and deletes them and tells what it cannot."""

import json
from pathlib import Path

import pytest

from faceposer.errors import FacePoserError
from faceposer.poses.library import PoseExistsError, PoseLibrary, safe_stem, starter_poses
from faceposer.poses.pose_file import Pose, read_pose, write_pose

SMILE = Pose("A smile", {"mouthSmileLeft": 0.5, "jawOpen": -0.25, "tongueOut": 0.0}, "man", ("expression",), "Wide.")


def test_a_pose_comes_back_and_its_file_is_as_documented(tmp_path: Path) -> None:
    path = PoseLibrary(tmp_path).save(SMILE)
    data = json.loads(path.read_text(encoding="utf-8"))
    assert data == {
        "format": "faceposer.pose",
        "version": 1,
        "name": "A smile",
        "subject": "man",
        "tags": ["expression"],
        "note": "Wide.",
        "weights": {"mouthSmileLeft": 0.5, "jawOpen": -0.25},
    }
    again = read_pose(path)
    assert (again.name, again.character, again.tags, again.note) == ("A smile", "man", ("expression",), "Wide.")
    assert dict(again.weights) == data["weights"]
    assert [p.name for p in tmp_path.iterdir()] == ["a-smile.json"], "no temporary file is left"


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"format": "x"}, 'no "format"'),
        ({"version": 2}, "version is 2"),
        ({"extra": 1}, "unknown key 'extra'"),
        ({"name": "  "}, "name of a pose must be"),
        ({"name": "two\nlines"}, "name of a pose must be"),
        ({"name": "x" * 81}, "name of a pose must be"),
        ({"tags": "viseme"}, "tags must be a list"),
        ({"subject": 3}, "subject must be a text"),
        ({"weights": None}, "weights must be an object"),
        ({"weights": {"jawOpen": "wide"}}, "weights.jawOpen must be a number"),
        ({"weights": {"jawOpen": True}}, "weights.jawOpen must be a number"),
        ({"weights": {"jawOpen": float("nan")}}, "weights.jawOpen must be a number"),
        ({"weights": {str(i): 0.0 for i in range(2001)}}, "at most 2000"),
    ],
)
def test_what_is_wrong_is_named_in_one_sentence(tmp_path: Path, change: dict[str, object], sentence: str) -> None:
    path = tmp_path / "a.json"
    path.write_text(json.dumps(SMILE.to_json() | change))
    with pytest.raises(FacePoserError) as refused:
        read_pose(path)
    assert sentence in str(refused.value)
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("content", [b"", b"{", b"\xff\xfe", b"[" * 100_000, b" " * (1 << 20) + b"{}"])
def test_files_that_are_no_poses_are_listed_with_a_sentence(tmp_path: Path, content: bytes) -> None:
    library = PoseLibrary(tmp_path)
    library.save(SMILE)
    (tmp_path / "broken.json").write_bytes(content)
    good, bad = library.entries()
    assert good.pose is not None
    assert bad.pose is None
    assert bad.title == "broken.json"
    assert "broken.json" in bad.problem
    assert bad.problem.endswith(".")


def test_a_library_replaces_only_when_it_may(tmp_path: Path) -> None:
    library = PoseLibrary(tmp_path / "not" / "there" / "yet")
    assert library.entries() == []
    path = library.save(SMILE)
    path.with_suffix(".png").write_bytes(b"old picture")
    with pytest.raises(PoseExistsError, match="already"):
        library.save(Pose("A SMILE", {"jawOpen": 1.0}))
    assert read_pose(path).name == "A smile"
    library.save(Pose("A SMILE", {"jawOpen": 1.0}), overwrite=True)
    assert read_pose(path).name == "A SMILE"
    assert not path.with_suffix(".png").exists(), "the picture was of another face"


def test_names_that_need_the_same_file_name_get_different_files(tmp_path: Path) -> None:
    library = PoseLibrary(tmp_path)
    names = ["Smile!", "Smile?", "smile", "!", "?", "con", "a" * 70, "a" * 71]
    files = [library.save(Pose(name, {"jawOpen": 0.1})) for name in names]
    assert len(set(files)) == len(names)
    for name, file in zip(names, files, strict=True):
        assert library.path_of(name) == file
        with pytest.raises(PoseExistsError, match="already has a pose"):
            library.save(Pose(name.upper(), {"jawOpen": 0.2}))
    library.save(Pose("Smile?", {"jawOpen": 0.5}), overwrite=True)
    assert library.find("Smile?").pose == Pose("Smile?", {"jawOpen": 0.5})
    assert library.find("Smile!").pose == Pose("Smile!", {"jawOpen": 0.1})
    library.rename(files[1], "Smile.")
    assert sorted(entry.title for entry in library.entries()) == sorted({*names, "Smile."} - {"Smile?"})


def test_renaming_takes_the_picture_along(tmp_path: Path) -> None:
    library = PoseLibrary(tmp_path)
    path = library.save(SMILE)
    path.with_suffix(".png").write_bytes(b"picture")
    library.save(Pose("Frown", {"jawOpen": 0.1}))
    with pytest.raises(PoseExistsError):
        library.rename(path, "frown")
    assert path.exists()
    renamed = library.rename(path, "Grin")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["frown.json", "grin.json", "grin.png"]
    assert read_pose(renamed).name == "Grin"
    assert library.rename(renamed, "GRIN") == renamed, "only the capitals change"
    assert library.find("grin").title == "GRIN"
    assert renamed.with_suffix(".png").exists()


def test_deleting_removes_file_and_picture(tmp_path: Path) -> None:
    library = PoseLibrary(tmp_path)
    path = library.save(SMILE)
    path.with_suffix(".png").write_bytes(b"picture")
    library.delete(path)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(FacePoserError, match="cannot be deleted"):
        library.delete(path)
    with pytest.raises(FacePoserError, match="no pose 'A smile'"):
        library.find("A smile")


def test_a_folder_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(FacePoserError, match="cannot be written"):
        PoseLibrary(tmp_path / "file").save(SMILE)


@pytest.mark.parametrize(
    ("name", "stem"),
    [
        ("A smile", "a-smile"),
        ("../../etc/passwd", "etc-passwd"),
        ("M / B : P?", "m-b-p"),
        ("CON", "pose-con"),
        ("...", "pose-"),
        ("Lächeln 2", "lächeln-2"),
        ("x" * 80, "x" * 60),
    ],
)
def test_names_become_safe_file_names(name: str, stem: str) -> None:
    assert safe_stem(name) == stem


def test_starter_poses_are_what_the_script_would_write(tmp_path: Path) -> None:
    from scripts.asset_building.starter_poses import STARTERS
    from scripts.build_poses import differences, people_poses

    entries = starter_poses()
    assert all(entry.shipped and entry.pose is not None for entry in entries), [e.problem for e in entries if e.problem]
    folder = entries[0].path.parent
    for name, pose in people_poses().items():
        assert differences(pose, folder / name) == ""
        write_pose(tmp_path / name, pose)
        assert (folder / name).read_bytes() == (tmp_path / name).read_bytes()
    titles = [one.name for one in STARTERS]
    for character in ("man", "creature"):
        mine = [entry.pose for entry in entries if entry.pose is not None and entry.pose.character == character]
        assert [pose.name for pose in mine] == titles
        kinds = [pose.tags[0] for pose in mine]
        assert (kinds.count("expression"), kinds.count("viseme")) == (7, 13)
