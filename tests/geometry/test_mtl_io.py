"""Textures of an OBJ file's materials are found as exporters refer to them, and what cannot be used is said."""

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from faceposer.geometry.mesh_io import read_mesh
from faceposer.geometry.mtl_io import read_obj_textures
from faceposer.geometry.texture_images import UnusableImageError, texture_image

OBJ = "mtllib {}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl skin #1\nf 1/1 2/2 3/3\n"


def image(form: str, mode: str = "RGB") -> bytes:
    data = io.BytesIO()
    Image.new(mode, (4, 2), 200 if mode == "L" else (200, 100, 50, 128)[: len(mode)]).save(data, format=form)
    return data.getvalue()


def textures(folder: Path, library: str = "a.mtl", obj: str = OBJ) -> tuple[dict[str, bytes], tuple[str, ...]]:
    (folder / "a.obj").write_text(obj.format(library))
    return read_obj_textures(folder / "a.obj", read_mesh(folder / "a.obj"))


@pytest.mark.parametrize(
    "reference",
    [
        *("skin.png", "./skin.png", "SKIN.PNG", "C:\\work\\head\\skin.png", "/home/me/skin.png"),
        *("-s 1 1 1 -o 0.5 0 skin.png", "-blendu on -mm 0 1 -clamp off skin.png", "-bm 1.0 -s 2 skin.png"),
    ],
)
def test_references_of_other_programs(reference: str, tmp_path: Path) -> None:
    (tmp_path / "skin.png").write_bytes(image("PNG"))
    (tmp_path / "a.mtl").write_text(f"# by hand\nnewmtl other\nnewmtl skin #1\nKd 1 1 1\n  map_Kd {reference}\n")
    assert textures(tmp_path) == ({"skin #1": image("PNG")}, ())


def test_names_with_spaces_and_several_libraries(tmp_path: Path) -> None:
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps" / "my skin.jpg").write_bytes(image("JPEG"))
    (tmp_path / "my head.mtl").write_bytes(b"\xef\xbb\xbfnewmtl skin #1\r\nmap_Kd maps\\my skin.jpg\r\n")
    assert textures(tmp_path, "my head.mtl") == ({"skin #1": image("JPEG")}, ())
    (tmp_path / "one.mtl").write_text("newmtl teeth\n")
    (tmp_path / "two.mtl").write_text("newmtl skin #1\nmap_Kd maps/my skin.jpg\n")
    assert textures(tmp_path, "one.mtl two.mtl") == ({"skin #1": image("JPEG")}, ())


def test_what_is_missing_damaged_or_elsewhere_is_said(tmp_path: Path) -> None:
    found, notes = textures(tmp_path)
    assert (found, len(notes)) == ({}, 1)
    assert (
        notes[0]
        == f"The material library 'a.mtl' is not read: there is no such file in the folder '{tmp_path}'; copy it there."
    )
    inside = tmp_path / "rig"
    inside.mkdir()
    (tmp_path / "skin.png").write_bytes(image("PNG"))
    for reference, said in (
        ("none.png", "there is no such file"),
        ("../skin.png", "there is no such file|outside"),
        ("link.png", "outside"),
        ("text.png", "not an image"),
        ("cut.png", "damaged"),
        ("skin.ktx2", "it is a KTX2 image, which cannot be read; save it as JPEG or PNG"),
        ("skin.psd", "it is a Photoshop document, which cannot be read; save it as JPEG or PNG"),
        ("skin.jpg", "it is a HEIC image, as iPhones take them, which cannot be read; save it as JPEG or PNG"),
        ("https://example.org/skin.png", "it is a URL, and nothing is downloaded; save it next to the file"),
        ("file:///skin.png", "it is a URL"),
    ):
        (inside / "a.mtl").write_text(f"newmtl skin #1\nmap_Kd {reference}\n")
        (inside / "text.png").write_text("no image")
        (inside / "cut.png").write_bytes(image("PNG")[:45])
        (inside / "skin.ktx2").write_bytes(b"\xabKTX 20\xbb")
        (inside / "skin.psd").write_bytes(b"8BPS\0\1")
        (inside / "skin.jpg").write_bytes(b"\0\0\0\x18ftypheic\0\0\0\0mif1heic")
        (inside / "link.png").unlink(missing_ok=True)
        (inside / "link.png").symlink_to(tmp_path / "skin.png")
        found, notes = textures(inside)
        assert not found
        assert any(reason in notes[0] for reason in said.split("|")), notes
        assert "'skin #1'" in notes[0]
    (inside / "a.mtl").write_text("newmtl skin #1\nmap_Kd skin.png\n")
    (inside / "skin.png").write_bytes(image("PNG"))
    bare = "mtllib {}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl skin #1\nf 1 2 3\n"
    assert textures(inside, obj=bare)[0] == {}
    assert "no texture coordinates" in textures(inside, obj=bare)[1][0]


@pytest.mark.parametrize(("form", "mode"), [("WEBP", "RGB"), ("TGA", "RGBA"), ("BMP", "RGB"), ("TIFF", "RGBA")])
def test_other_formats_become_png(form: str, mode: str) -> None:
    converted = texture_image(image(form, mode))
    with Image.open(io.BytesIO(converted)) as opened:
        assert (opened.format, opened.mode, opened.size) == ("PNG", mode, (4, 2))
        assert np.abs(np.asarray(opened)[0, 0, :3].astype(int) - (200, 100, 50)).max() < 8
    for kept in ("PNG", "JPEG"):
        assert texture_image(image(kept)) == image(kept)
    with pytest.raises(UnusableImageError):
        texture_image(b"")
