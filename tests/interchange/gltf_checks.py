"""What the standard asks of a GLB, told from its bytes alone."""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

SIZES = {5121: 1, 5123: 2, 5125: 4, 5126: 4}
DTYPES = {5123: "<u2", 5125: "<u4", 5126: "<f4"}
COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}


def chunks(path: Path) -> tuple[dict[str, Any], bytes]:
    """Return the JSON and the binary chunk, with the container checked."""
    data = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    assert size % 4 == 0
    document = json.loads(data[20 : 20 + size])
    binary_size, kind = struct.unpack_from("<I4s", data, 20 + size)
    assert kind == b"BIN\0"
    assert binary_size % 4 == 0
    assert 28 + size + binary_size == len(data)
    return document, data[28 + size :]


def values(document: dict[str, Any], binary: bytes, number: int) -> np.ndarray:
    """Return what an accessor holds."""
    accessor = document["accessors"][number]
    view = document["bufferViews"][accessor["bufferView"]]
    count = accessor["count"] * COLUMNS[accessor["type"]]
    begin = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    array = np.frombuffer(binary, DTYPES[accessor["componentType"]], count, begin)
    return array.reshape(accessor["count"], -1)


def check(path: Path) -> dict[str, Any]:
    """Check what the validator checks most, and return the JSON."""
    document, binary = chunks(path)
    assert document["buffers"] == [{"byteLength": len(binary)}]
    for view in document["bufferViews"]:
        assert view["byteOffset"] % 4 == 0
        assert view["byteLength"] > 0
        assert view["byteOffset"] + view["byteLength"] <= len(binary)
    for number, accessor in enumerate(document["accessors"]):
        view = document["bufferViews"][accessor["bufferView"]]
        columns = COLUMNS[accessor["type"]]
        assert accessor["count"] * columns * SIZES[accessor["componentType"]] <= view["byteLength"]
        array = values(document, binary, number)
        assert np.isfinite(array.astype(float)).all()
        if "min" in accessor:
            np.testing.assert_array_equal(np.float32(accessor["min"]), array.min(axis=0))
            np.testing.assert_array_equal(np.float32(accessor["max"]), array.max(axis=0))
    for mesh in document["meshes"]:
        counts = {len(primitive.get("targets", [])) for primitive in mesh["primitives"]}
        assert len(counts) == 1
        targets = counts.pop()
        assert len(mesh.get("weights", [])) == targets
        assert len(mesh.get("extras", {}).get("targetNames", [])) == targets
        for primitive in mesh["primitives"]:
            _check_primitive(document, binary, primitive)
    for animation in document.get("animations", []):
        _check_animation(document, binary, animation)
    return document


def _check_primitive(document: dict[str, Any], binary: bytes, primitive: dict[str, Any]) -> None:
    positions = document["accessors"][primitive["attributes"]["POSITION"]]
    assert {"min", "max"} <= positions.keys()
    for attributes in (primitive["attributes"], *primitive.get("targets", [])):
        assert all(document["accessors"][number]["count"] == positions["count"] for number in attributes.values())
        assert {"min", "max"} <= document["accessors"][attributes["POSITION"]].keys()
    normals = values(document, binary, primitive["attributes"]["NORMAL"])
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=5e-4)
    indices = values(document, binary, primitive["indices"])
    assert len(indices) % 3 == 0
    assert indices.max() == positions["count"] - 1
    assert document["materials"][primitive["material"]]["name"]


def _check_animation(document: dict[str, Any], binary: bytes, animation: dict[str, Any]) -> None:
    assert animation["channels"]
    for channel in animation["channels"]:
        assert channel["target"]["path"] == "weights"
        mesh = document["meshes"][document["nodes"][channel["target"]["node"]]["mesh"]]
        sampler = animation["samplers"][channel["sampler"]]
        times = values(document, binary, sampler["input"])[:, 0]
        assert {"min", "max"} <= document["accessors"][sampler["input"]].keys()
        assert times[0] == 0
        assert (np.diff(times) > 0).all()
        assert document["accessors"][sampler["output"]]["count"] == len(times) * len(mesh["weights"])
