"""Faces with morph targets come out of glTF as they were put in, and broken files are refused in one sentence."""

import base64
import json
import os
import re
import struct
import warnings
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import pytest
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.gltf_io import read_gltf
from faceposer.geometry.polygon_mesh import Group
from faceposer.geometry.rig_io import read_rig

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]], dtype=np.float32)
QUAD = np.array([0, 1, 2, 0, 2, 3], dtype=np.uint16)
SMILE = np.array([[0, 0, 0], [0.25, 0, 0], [0, -0.5, 0], [0, 0, 1]], dtype=np.float32)
FROWN = -2 * SMILE
PNG = base64.b64decode(b"iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR42mNgYGAAAAAEAAHI6uv5AAAAAElFTkSuQmCC")
COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}


class Builder:
    """Writes GLB, right or wrong."""

    def __init__(self) -> None:
        self.blob = bytearray()
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0"},
            **{k: [] for k in ("accessors", "bufferViews", "meshes", "nodes")},
        }

    def view(self, data: bytes, **more: Any) -> int:
        self.blob += bytes(-len(self.blob) % 4)
        view = {"buffer": 0, "byteOffset": len(self.blob), "byteLength": len(data), **more}
        self.json["bufferViews"].append(view)
        self.blob += data
        return len(self.json["bufferViews"]) - 1

    def accessor(self, values: NDArray[Any], **more: Any) -> int:
        columns = values.shape[1] if values.ndim == 2 else 1
        kind = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}[columns]
        component = COMPONENTS[values.dtype.str[1:]]
        entry = {"componentType": component, "count": len(values), "type": kind}
        if "sparse" not in more:
            entry["bufferView"] = self.view(values.tobytes())
        self.json["accessors"].append({**entry, **more})
        return len(self.json["accessors"]) - 1

    def primitive(
        self,
        points: NDArray[Any] = POINTS,
        indices: NDArray[Any] | None = QUAD,
        targets: tuple[NDArray[Any], ...] = (),
        **more: Any,
    ) -> dict[str, Any]:
        primitive: dict[str, Any] = {"attributes": {"POSITION": self.accessor(points)}, **more}
        if indices is not None:
            primitive["indices"] = self.accessor(indices)
        if targets:
            primitive["targets"] = [{"POSITION": self.accessor(target)} for target in targets]
        return primitive

    def mesh(self, *primitives: dict[str, Any], names: Any = None, **more: Any) -> int:
        extras = {} if names is None else {"extras": {"targetNames": names}}
        self.json["meshes"].append({"primitives": list(primitives), **extras, **more})
        return len(self.json["meshes"]) - 1

    def node(self, **entries: Any) -> int:
        self.json["nodes"].append(entries)
        return len(self.json["nodes"]) - 1

    def bytes(self) -> bytes:
        self.json.setdefault("buffers", [{"byteLength": len(self.blob)}])
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        blob = bytes(self.blob) + bytes(-len(self.blob) % 4)
        head = struct.pack("<4sIIII", b"glTF", 2, 28 + len(text) + len(blob), len(text), 0x4E4F534A)
        return head + text + struct.pack("<II", len(blob), 0x004E4942) + blob

    def write(self, path: Path) -> Path:
        path.write_bytes(self.bytes())
        return path


def face(**more: Any) -> Builder:
    """Return a file with one mesh of four vertices, two triangles and two targets."""
    builder = Builder()
    mesh = builder.mesh(builder.primitive(targets=(SMILE, FROWN)), names=["smile", "frown"], name="skin")
    builder.node(mesh=mesh, name="head", **more)
    return builder


def test_one_mesh_comes_back_as_it_was(tmp_path: Path) -> None:
    rig = read_gltf(face().write(tmp_path / "a.glb"))
    np.testing.assert_array_equal(rig.mesh.vertices, POINTS)
    assert rig.mesh.polygons.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert rig.mesh.groups == (Group("head", (0, 2)),)
    assert list(rig.targets) == ["smile", "frown"]
    np.testing.assert_array_equal(rig.targets["smile"], SMILE)
    np.testing.assert_array_equal(rig.targets["frown"], FROWN)
    assert {offsets.dtype for offsets in rig.targets.values()} == {np.dtype(np.float32)}
    assert len(rig.mesh.uv) == 0


def test_files_of_another_writer_in_all_three_forms(tmp_path: Path) -> None:
    pygltflib = pytest.importorskip("pygltflib", reason="the package pygltflib is not installed")
    built = face()
    built.bytes()
    gltf = pygltflib.GLTF2.gltf_from_json(json.dumps(built.json))
    gltf.set_binary_blob(bytes(built.blob))
    gltf.save(tmp_path / "a.glb")
    # It tells of what it does by warnings.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        gltf.save(tmp_path / "b.gltf")
        gltf.convert_buffers(pygltflib.BufferFormat.DATAURI)
    gltf.set_binary_blob(None)
    gltf.save(tmp_path / "c.gltf")
    assert (tmp_path / "b.bin").is_file()
    assert "base64" in (tmp_path / "c.gltf").read_text()
    for name in ("a.glb", "b.gltf", "c.gltf"):
        rig = read_gltf(tmp_path / name)
        np.testing.assert_array_equal(rig.mesh.vertices, POINTS)
        np.testing.assert_array_equal(rig.targets["frown"], FROWN)


def test_several_meshes_are_one_with_their_nodes_transforms(tmp_path: Path) -> None:
    builder = face(translation=[0, 0, 3], scale=[2, 2, 2])
    teeth = builder.mesh(
        builder.primitive(POINTS[:3], QUAD[:3], targets=(SMILE[:3],)), builder.primitive(), names=["smile"]
    )
    # A quarter turn about z: x becomes y; seen in the mirror z of a parent, which turns the faces round.
    child = builder.node(mesh=teeth, name="teeth", rotation=[0, 0, 0.5**0.5, 0.5**0.5])
    builder.node(children=[child], matrix=[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0, 10, 0, 0, 1])
    builder.json["meshes"][1]["primitives"][1]["targets"] = builder.json["meshes"][0]["primitives"][0]["targets"][1:]
    rig = read_gltf(builder.write(tmp_path / "a.glb"))
    turned = POINTS[:, [1, 0, 2]] * [-1, 1, -1] + [10, 0, 0]
    np.testing.assert_allclose(rig.mesh.vertices, np.vstack([POINTS * 2 + [0, 0, 3], turned[:3], turned]), atol=1e-12)
    assert rig.mesh.polygons.tolist() == [[0, 1, 2], [0, 2, 3], [4, 6, 5], [7, 9, 8], [7, 10, 9]]
    assert rig.mesh.groups == (Group("head", (0, 2)), Group("teeth 1", (2, 3)), Group("teeth 2", (3, 5)))
    assert list(rig.targets) == ["smile", "frown"]
    smile = np.vstack([2 * SMILE, SMILE[:3, [1, 0, 2]] * [-1, 1, -1], FROWN[:, [1, 0, 2]] * [-1, 1, -1]])
    np.testing.assert_allclose(rig.targets["smile"], smile, atol=1e-6)
    np.testing.assert_allclose(rig.targets["frown"], np.vstack([2 * FROWN, np.zeros((7, 3))]), atol=1e-6)


def test_only_the_default_scene_is_shown(tmp_path: Path) -> None:
    builder = face()
    lamp = builder.node(name="stand", children=[builder.node(mesh=0, name="below")])
    builder.json["scenes"] = [{"nodes": [lamp]}, {"nodes": [0]}]
    assert len(read_gltf(builder.write(tmp_path / "a.glb")).mesh.vertices) == 8
    builder.json["scene"] = 0
    assert read_gltf(builder.write(tmp_path / "a.glb")).mesh.groups[0].name == "below"
    builder.json["scenes"][0]["nodes"] = []
    with pytest.raises(FacePoserError, match="has no mesh with faces"):
        read_gltf(builder.write(tmp_path / "a.glb"))


def test_primitives_with_the_same_vertices_share_them(tmp_path: Path) -> None:
    builder = face()
    primitive = builder.json["meshes"][0]["primitives"][0]
    builder.json["materials"] = [{"name": "lips"}, {"name": "lips"}, {}]
    builder.json["meshes"][0]["primitives"] = [
        {**primitive, "material": i, "indices": builder.accessor(QUAD[3 * (i % 2) :][:3])} for i in range(3)
    ]
    rig = read_gltf(builder.write(tmp_path / "a.glb"))
    assert len(rig.mesh.vertices) == 4
    assert rig.mesh.polygons.tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 2]]
    assert [group.material for group in rig.mesh.groups] == ["lips", "lips (2)", "material 3"]


def test_quantised_and_strided_and_sparse_values(tmp_path: Path) -> None:
    builder = Builder()
    shorts = np.array([[0, 32767, -32768], [16384, 0, 0], [0, 0, 0]], dtype=np.int16)
    padded = np.hstack([shorts, np.full((3, 1), 99, np.int16)])
    position = builder.accessor(shorts, normalized=True, bufferView=builder.view(padded.tobytes(), byteStride=8))
    indices = builder.view(np.array([2], dtype=np.uint8).tobytes())
    values = builder.view(np.array([[1, 2, 3]], dtype=np.float32).tobytes())
    sparse = {"count": 1, "indices": {"bufferView": indices, "componentType": 5121}, "values": {"bufferView": values}}
    zeros = np.zeros((3, 3), dtype=np.float32)
    alone = builder.accessor(zeros, sparse=sparse)
    over = builder.accessor(zeros, sparse=sparse, bufferView=builder.view((zeros + 7).tobytes()))
    bytes_target = builder.accessor(np.array([[1, -128, 127]] * 3, dtype=np.int8))
    builder.mesh(
        {
            "attributes": {"POSITION": position},
            "targets": [{"POSITION": alone}, {"POSITION": over}, {"POSITION": bytes_target}, {}],
        },
        names=["alone", "over", "bytes"],
    )
    builder.node(mesh=0)
    rig = read_gltf(builder.write(tmp_path / "a.glb"))
    np.testing.assert_allclose(rig.mesh.vertices, [[0, 1, -1], [16384 / 32767, 0, 0], [0, 0, 0]])
    assert rig.mesh.polygons.tolist() == [[0, 1, 2]]
    assert rig.targets["alone"].tolist() == [[0, 0, 0], [0, 0, 0], [1, 2, 3]]
    assert rig.targets["over"].tolist() == [[7, 7, 7], [7, 7, 7], [1, 2, 3]]
    assert rig.targets["bytes"].tolist() == [[1, -128, 127]] * 3
    assert not rig.targets["target 4"].any()


def test_strips_and_fans_become_triangles_and_lines_are_left_out(tmp_path: Path) -> None:
    builder = Builder()
    strip = np.array([0, 1, 3, 2, 2], dtype=np.uint32)
    fan = np.array([0, 1, 2, 3], dtype=np.uint8)
    primitives = [builder.primitive(indices=strip, mode=5), builder.primitive(indices=fan, mode=6)]
    builder.mesh(builder.primitive(mode=1), *primitives, builder.primitive(mode=0))
    builder.node(mesh=0)
    rig = read_gltf(builder.write(tmp_path / "a.glb"))
    assert rig.mesh.polygons.tolist() == [[0, 1, 3], [1, 2, 3], [5, 6, 4], [6, 7, 4]]
    assert [group.name for group in rig.mesh.groups] == ["mesh 1 2", "mesh 1 3"]


@pytest.mark.parametrize("kind", ["view", "file", "uri"])
def test_texture_coordinates_and_pictures(tmp_path: Path, kind: str) -> None:
    builder = face()
    uv = np.array([[0, 0], [1, 0], [1, 1], [0.25, 0.5]], dtype=np.float32)
    primitive = builder.json["meshes"][0]["primitives"][0]
    primitive["attributes"]["TEXCOORD_0"] = builder.accessor(uv)
    primitive["material"] = 1
    (tmp_path / "a b.png").write_bytes(PNG)
    image = {
        "view": {"bufferView": builder.view(PNG), "mimeType": "image/png"},
        "file": {"uri": "a%20b.png"},
        "uri": {"uri": "data:image/png;base64," + base64.b64encode(PNG).decode()},
    }[kind]
    builder.json["images"] = [{"uri": "missing.png"}, image, {"uri": "data:image/ktx2;base64,AAAA"}]
    builder.json["textures"] = [{"extensions": {"KHR_texture_basisu": {"source": 2}}}, {"source": 1}, {"source": 0}]
    builder.json["materials"] = [
        {"name": f"m{i}", "pbrMetallicRoughness": {"baseColorTexture": {"index": i}}} for i in range(3)
    ]
    path = builder.write(tmp_path / "a.glb")
    rig = read_gltf(path)
    assert rig.textures == {"m1": PNG}
    np.testing.assert_allclose(rig.mesh.uv, [[0, 1], [1, 1], [1, 0], [0.25, 0.5]])
    assert rig.mesh.polygon_uvs.tolist() == rig.mesh.polygons.tolist()
    for material in (0, 2):
        primitive["material"] = material
        assert read_gltf(builder.write(path)).textures == {}
    transform = {"offset": [0.5, 0], "rotation": np.pi / 2, "scale": [2, 1]}
    texture = builder.json["materials"][2]["pbrMetallicRoughness"]["baseColorTexture"]
    texture["extensions"] = {"KHR_texture_transform": transform}
    # The extension's own example: offset times rotation (clockwise, v down) times scale.
    np.testing.assert_allclose(
        read_gltf(builder.write(path)).mesh.uv, [[0.5, 1], [0.5, 3], [1.5, 3], [1, 1.5]], atol=1e-12
    )


def test_names_of_targets_wherever_they_are(tmp_path: Path) -> None:
    builder = face()
    mesh = builder.json["meshes"][0]
    primitive = mesh["primitives"][0]
    path = tmp_path / "a.glb"
    mesh["extras"] = {"targetNames": ["", "two\nlines"]}
    assert list(read_gltf(builder.write(path)).targets) == ["target 1", "two lines"]
    mesh["extras"] = "anything is allowed here"
    assert list(read_gltf(builder.write(path)).targets) == ["target 1", "target 2"]
    for i, target in enumerate(primitive["targets"]):
        builder.json["accessors"][target["POSITION"]]["name"] = f"shape{i}"
    assert list(read_gltf(builder.write(path)).targets) == ["shape0", "shape1"]
    primitive["extras"] = {"targetNames": ["jawOpen"]}
    assert list(read_gltf(builder.write(path)).targets) == ["jawOpen", "target 2"]
    mesh["extras"] = {"targetNames": ["smile", "smile"]}
    unusable = read_gltf(builder.write(path)).unusable["smile"]
    assert re.search(r"a\.glb' has two targets named 'smile' .* 'skin', numbers 1 and 2", unusable)


def test_the_deformers_of_several_meshes_share_their_targets(tmp_path: Path) -> None:
    builder = face()
    builder.json["meshes"][0]["extras"]["targetNames"] = ["blendShape1.jawOpen", "blendShape1.eyeBlink_L"]
    path = tmp_path / "a.glb"
    assert list(read_gltf(builder.write(path)).targets) == ["blendShape1.jawOpen", "blendShape1.eyeBlink_L"]
    lashes = builder.mesh(builder.primitive(targets=(FROWN,)), names=["blendShape2.eyeBlink_L"])
    builder.node(mesh=lashes)
    builder.json.pop("buffers")
    rig = read_gltf(builder.write(path))
    assert list(rig.targets) == ["jawOpen", "eyeBlink_L"]
    np.testing.assert_array_equal(rig.targets["eyeBlink_L"], np.vstack([FROWN, FROWN]))
    builder.json["meshes"][1]["extras"]["targetNames"] = ["eyeBlink.L"]
    builder.json["meshes"][0]["extras"]["targetNames"] = ["jawOpen", "eyeBlink.L"]
    assert list(read_gltf(builder.write(path)).targets) == ["jawOpen", "eyeBlink.L"]


def skinned(joint_matrices: list[list[float]], inverse_bind: NDArray[np.float32]) -> Builder:
    builder = face(translation=[100, 0, 0], skin=0)
    attributes = builder.json["meshes"][0]["primitives"][0]["attributes"]
    attributes["JOINTS_0"] = builder.accessor(np.array([[0, 1, 0, 0]] * 4, dtype=np.uint8))
    weights = np.array([[255, 0, 0, 0], [255, 0, 0, 0], [0, 255, 0, 0], [0, 255, 0, 0]], dtype=np.uint8)
    attributes["WEIGHTS_0"] = builder.accessor(weights, normalized=True)
    joints = [builder.node(matrix=matrix) for matrix in joint_matrices]
    builder.json["skins"] = [{"joints": joints, "inverseBindMatrices": builder.accessor(inverse_bind)}]
    return builder


def test_skinned_meshes_stand_where_their_joints_carry_them(tmp_path: Path) -> None:
    eye = np.eye(4)
    lift, away = eye.copy(), eye.copy()
    lift[1, 3], away[0, 3] = 1 / 3, 1 / 7
    columns = lambda *matrices: [matrix.T.ravel().tolist() for matrix in matrices]  # noqa: E731
    back = np.array(columns(np.linalg.inv(lift), np.linalg.inv(away)), dtype=np.float32)
    path = tmp_path / "a.glb"
    # At rest in the bind pose, the positions are the file's, to the bit.
    rig = read_gltf(skinned(columns(lift, away), back).write(path))
    np.testing.assert_array_equal(rig.mesh.vertices, POINTS)
    # An armature that is scaled moves all alike.
    small = np.diag([0.5, 0.5, 0.5, 1])
    rig = read_gltf(skinned(columns(small @ lift, small @ away), back).write(path))
    np.testing.assert_allclose(rig.mesh.vertices, POINTS / 2, atol=1e-6)
    np.testing.assert_allclose(rig.targets["smile"], SMILE / 2, atol=1e-6)
    # A joint that rests elsewhere takes its vertices along.
    rig = read_gltf(skinned(columns(lift, small @ away), back).write(path))
    np.testing.assert_allclose(rig.mesh.vertices, np.vstack([POINTS[:2], POINTS[2:] / 2]), atol=1e-6)
    np.testing.assert_allclose(rig.targets["smile"], np.vstack([SMILE[:2], SMILE[2:] / 2]), atol=1e-6)


@pytest.mark.parametrize("version", [0, 1])
def test_expressions_of_avatars_are_targets(tmp_path: Path, version: int) -> None:
    builder = face()
    builder.json["meshes"][0]["extras"]["targetNames"] = ["Fcl_Smile", "jaw_Open"]
    builder.node(mesh=builder.mesh(builder.primitive()), name="teeth")

    def bind(target: int, weight: float, number: int = 0) -> dict[str, Any]:
        if version == 0:
            return {"mesh": number, "index": target, "weight": 100 * weight}
        return {"node": number, "index": target, "weight": weight}

    clips = {
        "MouthSmileLeft": [bind(0, 0.5), bind(1, 1.0)],
        "JawOpen": [bind(1, 1)],
        "Blank": [],
        "Broken": [bind(0, 1), bind(0, 1, 9)],
        "Missing": [bind(7, 1)],
    }
    if version == 0:
        groups = [{"name": name, "presetName": "unknown", "binds": binds} for name, binds in clips.items()]
        groups.append({"presetName": "joy", "binds": [bind(0, 1)]})
        builder.json["extensions"] = {"VRM": {"blendShapeMaster": {"blendShapeGroups": groups}}}
    else:
        expressions = {name: {"morphTargetBinds": binds} for name, binds in clips.items()}
        joy = {"joy": {"morphTargetBinds": [bind(0, 1)]}}
        builder.json["extensions"] = {"VRMC_vrm": {"expressions": {"custom": expressions, "preset": joy}}}
    rig = read_gltf(builder.write(tmp_path / "a.vrm"))
    assert set(rig.targets) == {"Fcl_Smile", "jaw_Open", "MouthSmileLeft", "joy"}
    np.testing.assert_allclose(rig.targets["MouthSmileLeft"][:4], 0.5 * SMILE + FROWN)
    assert not rig.targets["MouthSmileLeft"][4:].any()
    np.testing.assert_array_equal(rig.targets["joy"], rig.targets["Fcl_Smile"])


@pytest.mark.parametrize(("version", "whole"), [(0, 1.0), (0, 100.0), (1, 1.0), (1, 100.0)])
def test_weights_of_avatars_may_be_of_the_other_version(version: int, whole: float, tmp_path: Path) -> None:
    builder = face()
    holder = {"mesh": 0} if version == 0 else {"node": 0}
    binds = {"A": [{**holder, "index": 0, "weight": 0.5 * whole}], "B": [{**holder, "index": 1, "weight": whole}]}
    if version == 0:
        groups = [{"name": name, "binds": group} for name, group in binds.items()]
        builder.json["extensions"] = {"VRM": {"blendShapeMaster": {"blendShapeGroups": groups}}}
    else:
        custom = {name: {"morphTargetBinds": group} for name, group in binds.items()}
        builder.json["extensions"] = {"VRMC_vrm": {"expressions": {"custom": custom}}}
    rig = read_gltf(builder.write(tmp_path / "a.vrm"))
    np.testing.assert_allclose(rig.targets["A"], 0.5 * SMILE, atol=1e-6)
    np.testing.assert_allclose(rig.targets["B"], FROWN, atol=1e-6)
    foreign = whole != (100.0 if version == 0 else 1.0)
    assert [f"they were read as 0 to {whole:g}" in note for note in rig.notes] == [True] * foreign
    given = read_rig(tmp_path / "a.vrm", weights_range=2.0 * whole)
    np.testing.assert_allclose(given.targets["B"], 0.5 * FROWN, atol=1e-6)
    assert not any("they were read as" in note for note in given.notes)


def test_textures_that_cannot_be_read_are_said(tmp_path: Path) -> None:
    for image, said in (
        ({"uri": "none.png"}, f"there is no such file in the folder '{tmp_path}'; copy it there"),
        ({"uri": "no%20ne.png"}, f"there is no such file in the folder '{tmp_path}'; copy it there"),
        ({"uri": "https://example.org/a.png"}, "it is a URL, and nothing is downloaded; save it next to the file"),
        ({"uri": "//example.org/a.png"}, "it is a URL, and nothing is downloaded; save it next to the file"),
        ({"uri": "../a.png"}, f"it lies outside of the folder '{tmp_path}'; copy it there"),
        ({"uri": "/etc/a.png"}, f"it lies outside of the folder '{tmp_path}'; copy it there"),
        ({"uri": "."}, "it is not a file"),
        ({"uri": "data:image/png;base64,@"}, "its data is missing or damaged|it is not an image"),
        ({"data": b"\xabKTX 20\xbb"}, "it is a KTX2 image, which cannot be read; save it as JPEG or PNG"),
        ({"data": b"8BPS\0\1"}, "it is a Photoshop document, which cannot be read; save it as JPEG or PNG"),
        ({"data": b"\0\0\0\x18ftypheic\0\0\0\0mif1heic"}, "it is a HEIC image, as iPhones take them"),
        ({"data": PNG[:40]}, "it is damaged"),
        ({"data": b"text"}, "it is not an image"),
    ):
        builder = face()
        builder.json["meshes"][0]["primitives"][0]["material"] = 0
        texture = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
        builder.json["materials"] = [{"name": "skin", **texture}]
        builder.json["textures"] = [{"source": 0}]
        data = image.pop("data", b"")
        builder.json["images"] = [image or {"bufferView": builder.view(data), "mimeType": "image/png"}]
        rig = read_gltf(builder.write(tmp_path / "a.glb"))
        assert not rig.textures
        assert re.search(f"of the material 'skin' is not used: ({said})", rig.notes[0]), rig.notes
        if "uri" in image and "data" not in str(image):
            # The file is named.
            assert f"'{unquote(str(image['uri']))}'" in rig.notes[0]


@pytest.mark.parametrize(
    ("extension", "said"),
    [
        ("KHR_draco_mesh_compression", "compressed with Draco, which cannot be read; export it without compression"),
        ("EXT_meshopt_compression", "compressed with meshopt, which"),
        ("KHR_meshopt_compression", "compressed with meshopt, which"),
        ("KHR_brand_new", "requires the extension 'KHR_brand_new' of glTF, which cannot be read"),
        ("KHR_mesh_quantization", ""),
        ("KHR_materials_unlit", ""),
        ("KHR_texture_basisu", ""),
        ("VRMC_vrm", ""),
    ],
)
def test_required_extensions_that_are_not_read_are_said(extension: str, said: str, tmp_path: Path) -> None:
    builder = face()
    builder.json["extensionsRequired"] = [extension]
    if not said:
        assert len(read_gltf(builder.write(tmp_path / "a.glb")).mesh.vertices)
        return
    with pytest.raises(FacePoserError, match=said):
        read_gltf(builder.write(tmp_path / "a.glb"))


def test_far_too_many_morph_targets_are_refused_before_they_are_read(tmp_path: Path) -> None:
    builder = face()
    primitive = builder.json["meshes"][0]["primitives"][0]
    primitive["targets"] = primitive["targets"][:1] * 10_000
    builder.json["meshes"][0].get("extras", {}).pop("targetNames", None)
    with pytest.raises(FacePoserError, match="has 10000 morph targets; at most 4000 are read"):
        read_gltf(builder.write(tmp_path / "a.glb"))


def broken(change: str) -> Builder:
    """Return a file with one thing wrong."""
    builder = face()
    json_, mesh = builder.json, builder.json["meshes"][0]
    primitive = mesh["primitives"][0]
    position, index = json_["accessors"][0], json_["accessors"][1]
    smile = json_["accessors"][2]
    nan = POINTS.copy()
    nan[2, 1] = np.nan
    actions = {
        "offset": lambda: json_["bufferViews"][0].update(byteOffset=1 << 20),
        "negative": lambda: json_["bufferViews"][0].update(byteOffset=-4),
        "count": lambda: position.update(count=5),
        "huge": lambda: position.update(count=1 << 31),
        "unbacked": lambda: (position.pop("bufferView"), position.update(count=4_000_000)),
        "type": lambda: position.update(type="VEC2"),
        "component": lambda: position.update(componentType=5124),
        "floats": lambda: index.update(componentType=5126, count=3),
        "index": lambda: builder.blob.__setitem__(slice(48, 50), b"\x09\x00"),
        "thirds": lambda: index.update(count=5),
        "target": lambda: smile.update(count=3),
        "text": lambda: position.update(count="many"),
        "accessor": lambda: primitive["attributes"].update(POSITION=77),
        "mesh": lambda: json_["nodes"][0].update(mesh=3),
        "list": lambda: json_.update(nodes={"a": 1}),
        "nan": lambda: primitive["attributes"].update(POSITION=builder.accessor(nan)),
        "nan target": lambda: primitive["targets"][1].update(POSITION=builder.accessor(nan)),
        "cycle": lambda: json_["nodes"].extend([{"children": [2]}, {"children": [1]}]),
        "parents": lambda: json_["nodes"].extend([{"children": [0]}, {"children": [0]}]),
        "scale": lambda: json_["nodes"][0].update(scale=[1e39, 1, 1]),
        "overflow": lambda: (
            json_["nodes"][0].update(scale=[1e29] * 3, children=[1])
            or json_["nodes"].append({"scale": [1e29] * 3, "mesh": 0})
        ),
        "material": lambda: primitive.update(material=0),
        "draco": lambda: (
            position.pop("bufferView"),
            primitive.update(extensions={"KHR_draco_mesh_compression": {"bufferView": 0}}),
        ),
        "meshopt": lambda: json_["bufferViews"][0].update(buffer=1, extensions={"EXT_meshopt_compression": {}}),
        "version": lambda: json_["asset"].update(version="1.0"),
        "asset": lambda: json_.pop("asset"),
        "nothing": lambda: json_.update(nodes=[]),
        "stride": lambda: json_["bufferViews"][0].update(byteStride=8),
    }
    actions[change]()
    return builder


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("offset", r"bufferViews\[0\]: its bytes 1048576 to 1048624 exceed its buffer"),
        ("negative", r"bufferViews\[0\]: 'byteOffset' is -4"),
        ("count", r"accessors\[0\]: its 5 entries end at byte 60 of a buffer view of 48"),
        ("huge", "has more than 5000000 vertices"),
        ("unbacked", r"accessors\[0\]: it has 4000000 entries without data"),
        ("type", r"accessors\[0\]: its type is 'VEC2', not VEC3"),
        ("component", r"accessors\[0\]: 'componentType' is 5124"),
        ("floats", r"accessors\[1\]: it must have integers"),
        ("index", r"meshes\[0\]\.primitives\[0\]: its index 1 is vertex 9 of 4"),
        ("thirds", "not a multiple of 3"),
        ("target", r"targets\[0\]: the target 'smile' has 3 vertices, its mesh 4"),
        ("text", r"accessors\[0\]: 'count' is the text 'many'"),
        ("accessor", "'POSITION' is 77, but there are 4 accessors"),
        ("mesh", r"nodes\[0\]: 'mesh' is 3"),
        ("list", "'nodes' must be a list"),
        ("nan", "position of vertex 3 is not finite"),
        ("nan target", "target 'frown' of vertex 3 is not finite"),
        ("cycle", r"nodes\[1\]: it is an ancestor of itself"),
        ("parents", r"nodes\[0\]: it is the child of two nodes, 1 and 2"),
        ("scale", r"nodes\[0\]: 'scale' must be 3 finite numbers"),
        ("overflow", "too far away"),
        ("material", "'material' is 0, but there are 0"),
        ("draco", "compressed with Draco"),
        ("version", r"is glTF 1\.0"),
        ("asset", "no 'asset'"),
        ("nothing", "has no mesh with faces"),
        ("stride", "overlap"),
    ],
)
def test_broken_files_are_refused_with_the_place(tmp_path: Path, change: str, said: str) -> None:
    path = broken(change).write(tmp_path / "a.glb")
    with pytest.raises(FacePoserError, match=said) as caught:
        read_gltf(path)
    assert str(path) in str(caught.value)


def test_meshopt_is_told_apart_from_broken_data(tmp_path: Path) -> None:
    builder = broken("meshopt")
    text = builder.bytes()
    builder.json["buffers"].append({"byteLength": 48, "extensions": {"EXT_meshopt_compression": {"fallback": True}}})
    path = tmp_path / "a.gltf"
    builder.json["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(text).decode()
    path.write_text(json.dumps(builder.json))
    with pytest.raises(FacePoserError, match="compressed with meshopt, which cannot be read; export it without"):
        read_gltf(path)


@pytest.mark.parametrize(
    ("uri", "said"),
    [
        ("gone.bin", r"needs '.*gone\.bin' \(buffers\[0\]\), which cannot be read: No such file"),
        ("https://example.org/a.bin", "not next to the rig"),
        ("data:application/octet-stream;base64,A", "not base64"),
        ("data:,short", "it has 5 of 240 bytes"),
        (".", "it is a folder"),
        ("a%00b", "cannot be read"),
    ],
)
def test_buffers_elsewhere(tmp_path: Path, uri: str, said: str) -> None:
    builder = face()
    builder.bytes()
    builder.json["buffers"] = [{"byteLength": 240, "uri": uri}]
    path = tmp_path / "a.gltf"
    path.write_text(json.dumps(builder.json))
    with pytest.raises(FacePoserError, match=said):
        read_gltf(path)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "not valid JSON at line 1, column 1"),
        (b"glTF", "truncated after 4 bytes"),
        (b"\xff\xfe\x00garbage", "does not begin as a .glb does"),
        (b'{"asset": {"version": "2.0"},\n nodes', "line 2, column 2"),
        (b"[" * 100_000, "not glTF"),
        (b"\xff\xfe\xfd", "not glTF"),
        (b"[]", "no 'asset'"),
    ],
)
def test_what_is_no_gltf(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "a.glb"
    path.write_bytes(content)
    with pytest.raises(FacePoserError, match=said):
        read_gltf(path)


def test_missing_and_huge_files(tmp_path: Path) -> None:
    with pytest.raises(FacePoserError, match=r"none\.glb' cannot be read: No such file"):
        read_gltf(tmp_path / "none.glb")
    with (tmp_path / "huge.glb").open("wb") as file:
        file.truncate((1 << 30) + 1)
    with pytest.raises(FacePoserError, match="larger than 1 GB"):
        read_gltf(tmp_path / "huge.glb")


def test_files_cut_off_anywhere_are_refused(tmp_path: Path) -> None:
    whole = face().bytes()
    path = tmp_path / "a.glb"
    for length in range(0, len(whole) - 1, 7):
        path.write_bytes(whole[:length])
        with pytest.raises(FacePoserError, match=r"a\.glb"):
            read_gltf(path)


EYES = np.tile(np.eye(4, dtype=np.float32).ravel(), (2, 1))


def reads_or_refuses(path: Path) -> bool:
    """Return whether the file can be read, as a mesh that is whole; anything but our own error comes out."""
    try:
        rig = read_gltf(path)
    except FacePoserError as error:
        if str(path) not in str(error):
            raise
        return False
    assert np.isfinite(rig.mesh.vertices).all()
    assert all(np.isfinite(offsets).all() for offsets in rig.targets.values())
    assert 0 <= rig.mesh.polygons.min() <= rig.mesh.polygons.max() < len(rig.mesh.vertices)
    return True


def test_whatever_bits_are_wrong_only_our_error_comes_out(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    builders = [face(), skinned([np.eye(4).ravel().tolist(), np.diag([2, 2, 2, 1]).ravel().tolist()], EYES)]
    builders[0].json["extensions"] = {
        "VRM": {"blendShapeMaster": {"blendShapeGroups": [{"name": "A", "binds": [{"mesh": 0, "index": 0}]}]}}
    }
    path = tmp_path / "a.glb"
    read = []
    for builder in builders:
        whole = np.frombuffer(builder.bytes(), dtype=np.uint8)
        digits = np.flatnonzero((whole >= ord("0")) & (whole <= ord("9")))
        for trial in range(700):
            changed = whole.copy()
            if trial % 2:
                places = rng.integers(0, len(whole), rng.integers(1, 4))
                changed[places] ^= rng.integers(1, 256, len(places), dtype=np.uint8)
            else:
                # A digit for a digit leaves JSON that can be read, with other numbers.
                changed[rng.choice(digits, 2)] = rng.integers(ord("0"), ord("9") + 1, 2)
            path.write_bytes(changed.tobytes())
            read.append(reads_or_refuses(path))
    assert 0.1 < np.mean(read) < 0.6


@pytest.mark.parametrize("value", [None, True, -1, 1.5, 1e300, "x", [], {}, [[]], 10**30, float("nan")])
def test_whatever_stands_in_the_json_only_our_error_comes_out(tmp_path: Path, value: Any) -> None:
    builder = skinned([np.eye(4).ravel().tolist(), np.diag([2, 2, 2, 1]).ravel().tolist()], EYES)
    move = {"KHR_texture_transform": {"offset": [0, 1], "rotation": 1, "texCoord": 0}}
    texture = {"index": 0, "texCoord": 0, "extensions": move}
    builder.json["materials"] = [{"name": "m", "pbrMetallicRoughness": {"baseColorTexture": texture}}]
    builder.json["textures"] = [{"source": 0}]
    builder.json["images"] = [{"bufferView": builder.view(PNG)}]
    builder.json["scene"] = 0
    builder.json["scenes"] = [{"nodes": [0]}]
    primitive = builder.json["meshes"][0]["primitives"][0]
    primitive["material"] = 0
    primitive["attributes"]["TEXCOORD_0"] = builder.accessor(POINTS[:, :2].copy())
    groups = [{"name": "A", "binds": [{"mesh": 0, "index": 0, "weight": 50}]}]
    expressions = {"custom": {"B": {"morphTargetBinds": [{"node": 0, "index": 0, "weight": 0.5}]}}}
    builder.json["extensions"] = {
        "VRM": {"blendShapeMaster": {"blendShapeGroups": groups}},
        "VRMC_vrm": {"expressions": expressions},
    }
    path = builder.write(tmp_path / "a.glb")
    rig = read_gltf(path)
    assert (list(rig.targets), rig.textures) == (["smile", "frown", "B", "A"], {"m": PNG})

    def replaced(tree: Any) -> list[Any]:
        """Return ``tree`` with one place after another replaced by ``value``."""
        trees = [value]
        items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
        for place, branch in items:
            for other in replaced(branch):
                trees.append(tree.copy())
                trees[-1][place] = other
        return trees

    buffers = builder.json["buffers"]
    for tree in replaced(builder.json):
        builder.json = tree if isinstance(tree, dict) else {"asset": {"version": "2.0"}, "buffers": buffers}
        reads_or_refuses(builder.write(path))


def rigs() -> Path:
    folder = os.environ.get("FACEPOSER_RIGS")
    if not folder:
        pytest.skip("FACEPOSER_RIGS is not set")
    return Path(folder)


def test_a_real_rig() -> None:
    rig = read_gltf(rigs() / "facecap.glb")
    assert rig.mesh.vertices.shape == (2659, 3)
    assert rig.mesh.polygons.shape == (5032, 3)
    assert len(rig.targets) == 52
    assert [name for name, offsets in rig.targets.items() if not offsets.any()] == ["tongueOut"]
    left = rig.mesh.vertices[np.abs(rig.targets["eyeBlink_L"]).max(axis=1) > 0.1]
    assert left[:, 0].min() > 0


def test_a_real_rig_of_several_meshes() -> None:
    rig = read_gltf(rigs() / "facecap_multi.glb")
    assert [group.name for group in rig.mesh.groups] == ["eyeLeft", "eyeRight", "teeth", "head"]
    assert rig.mesh.groups[-1].polygons[1] == len(rig.mesh.polygons)
    head = read_gltf(rigs() / "facecap.glb")
    assert list(rig.targets) == list(head.targets)
    assert not rig.targets["jawOpen"][:482].any()
    assert rig.mesh.vertices[:482, 0].max() < rig.mesh.vertices[:, 0].max()


@pytest.mark.parametrize(
    "uri", ["../a.bin", "..%2Fa.bin", "/etc/hostname", "sub/../../a.bin", "link/a.bin", "link.bin"]
)
def test_buffers_and_images_stay_in_the_folder(tmp_path: Path, uri: str) -> None:
    (tmp_path / "a.bin").write_bytes(bytes(240))
    folder = tmp_path / "rig"
    (folder / "sub").mkdir(parents=True)
    (folder / "link").symlink_to(tmp_path)
    (folder / "link.bin").symlink_to(tmp_path / "a.bin")
    builder = face()
    builder.bytes()
    builder.json["buffers"] = [{"byteLength": 240, "uri": uri}]
    path = folder / "a.gltf"
    path.write_text(json.dumps(builder.json))
    with pytest.raises(FacePoserError, match="outside the rig's folder"):
        read_gltf(path)


def test_buffers_in_folders_below_are_read(tmp_path: Path) -> None:
    builder = face()
    binary = builder.bytes()
    (tmp_path / "data set").mkdir()
    length = int.from_bytes(binary[12:16], "little")
    (tmp_path / "data set" / "a.bin").write_bytes(binary[28 + length :])
    builder.json["buffers"] = [{"byteLength": len(binary) - 28 - length, "uri": "./data%20set/a.bin"}]
    path = tmp_path / "a.gltf"
    path.write_text(json.dumps(builder.json))
    assert len(read_gltf(path).mesh.vertices)
