"""Names of files to write have one suffix, which decides what is written."""

from pathlib import Path

import pytest

from faceposer.errors import FacePoserError
from faceposer.files.names import save_path, suffix_replaced
from faceposer.interchange.formats import FORMATS

ALL = tuple(FORMATS)


@pytest.mark.parametrize("chosen", ALL)
@pytest.mark.parametrize("stem", ["face", "v1.2 smile", "v1.2", "Dr. No", "take.final", ".hidden", "ä.ö"])
def test_every_format_is_named_once(chosen: str, stem: str) -> None:
    wanted = f"{stem}{chosen}"
    for typed in (stem, wanted, f"{wanted}{chosen}", f"{wanted}{chosen.upper()}{chosen}", f"{stem}.", f"{stem}.fbx"):
        assert save_path(Path("there") / typed, chosen) == Path("there") / wanted
    for other in ALL:
        assert save_path(Path(f"{stem}{other}"), chosen, ALL).name == f"{stem}{other}", "the suffix typed decides"
        assert save_path(Path(f"{wanted}{other}"), chosen, ALL).name == f"{stem}{other}"
        assert save_path(Path(f"{stem}{other}"), chosen).name == wanted, "or is replaced"


@pytest.mark.parametrize(
    ("typed", "chosen", "saved"),
    [
        ("face.GIF", ".gif", "face.GIF"),
        ("face.obj.json", ".json", "face.json"),
        ("face.gif", ".json", "face.json"),
        ("face.png", ".npz", "face.npz"),
        ("smile.v2", ".obj", "smile.v2.obj"),
        ("take", "", "take"),
        ("take.obj", "", "take"),
        ("v1.2 take", "", "v1.2 take"),
    ],
)
def test_sessions_characters_and_folders_too(typed: str, chosen: str, saved: str) -> None:
    assert save_path(Path(typed), chosen).name == saved


@pytest.mark.parametrize("typed", [".obj", ".obj.gif", " .obj", "..obj"])
def test_a_suffix_alone_is_no_name(typed: str) -> None:
    with pytest.raises(FacePoserError, match="is not a file name"):
        save_path(Path(typed), ".obj")


def test_what_was_replaced_is_known() -> None:
    assert suffix_replaced(Path("face.gif"), Path("face.glb"))
    assert suffix_replaced(Path("face.obj.obj"), Path("face.obj"))
    assert not suffix_replaced(Path("v1.2 smile"), Path("v1.2 smile.glb"))
    assert not suffix_replaced(Path("face.gif"), Path("face.gif"))
