"""Files that belong to meshes are found, and no output replaces them."""

import json
from pathlib import Path

import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh_companions import check_not_of_meshes, companions_of

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
CORNERS = "vt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"
LIBRARY = "newmtl a\nmap_Kd -s 1 1 1 tex.png\nbump bumps.png\nmap_Ks maps\\shine.png\nnewmtl b\nmap_Kd missing.png\n"
PLY = "ply\nformat ascii 1.0\n{}element vertex 3\nproperty float x\nproperty float {}\nend_header\n"
GLTF = {"asset": {"version": "2.0"}, "buffers": [{"uri": "a%20b.bin"}], "images": [{"uri": "tex.png"}, {"uri": 5}]}


def glb(data: object) -> bytes:
    """Return a binary glTF with only a chunk of JSON."""
    text = json.dumps(data).encode()
    words = (2, 20 + len(text), len(text), 0x4E4F534A)
    return b"glTF" + b"".join(word.to_bytes(4, "little") for word in words) + text


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("head.obj", f"mtllib my lib.mtl\n{TRIANGLE}{CORNERS}", {"my lib.mtl", "tex.png", "bumps.png", "shine.png"}),
        ("head.obj", f"mtllib no.mtl\n{TRIANGLE}{CORNERS}", {"head.png"}),
        ("head.obj", f"{TRIANGLE}{CORNERS}", {"head.png"}),
        ("head.obj", f"{TRIANGLE}f 1 2 3\n", set()),
        ("head.ply", PLY.format("comment TextureFile tex.png\n", "s"), {"tex.png"}),
        ("head.ply", PLY.format("", "s"), {"head.png"}),
        ("head.ply", PLY.format("", "y"), set()),
        ("head.gltf", json.dumps(GLTF), {"a b.bin", "tex.png"}),
        ("head.glb", glb(GLTF), {"a b.bin", "tex.png"}),
        ("head.gltf", "{", set()),
        ("head.glb", b"glTF\x02", set()),
        ("head.stl", "solid", set()),
    ],
)
def test_files_of_a_mesh(tmp_path: Path, name: str, content: str | bytes, expected: set[str]) -> None:
    (tmp_path / "maps").mkdir()
    for other in ("tex.png", "bumps.png", "maps/shine.png", "head.png", "a b.bin", "other.png"):
        (tmp_path / other).write_bytes(b"kept")
    (tmp_path / "my lib.mtl").write_text(LIBRARY)
    mesh = tmp_path / name
    mesh.write_bytes(content if isinstance(content, bytes) else content.encode())
    assert {path.name for path in companions_of(mesh)} == expected
    for path in [mesh, *companions_of(mesh)]:
        with pytest.raises(FacePoserError, match="is also an input; give the output another name"):
            check_not_of_meshes(path, mesh)
    check_not_of_meshes(tmp_path / "other.png", mesh)
    check_not_of_meshes(tmp_path / "new.png", mesh)
    check_not_of_meshes(None, mesh)


def test_a_missing_mesh_has_no_files(tmp_path: Path) -> None:
    assert companions_of(tmp_path / "head.obj") == []
    check_not_of_meshes(tmp_path / "head.png", tmp_path / "head.obj")
