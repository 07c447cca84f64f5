"""Small valid files of every kind that the program reads, from which the mutations of fuzz.py begin."""

import io
import json
import warnings
from pathlib import Path
from typing import Any

import c3d
import numpy as np
from PIL import Image

from faceposer.geometry.obj_io import write_obj
from faceposer.geometry.ply_io import write_ply
from faceposer.geometry.polygon_mesh import Group
from faceposer.identity.identity import Identity, SkinTexture
from faceposer.identity.skin_layers import SkinLayers
from faceposer.identity.template import head_template
from faceposer.interchange.gltf_builder import GltfBuilder
from faceposer.interchange.live_link import write_live_link
from faceposer.interchange.weights_json import write_weights
from faceposer.model.character_file import save_character
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.poses.pose_file import Pose
from faceposer.session.document import Document, write_document
from faceposer.session.opening import load_model

_DRAWINGS = Path(__file__).resolve().parents[2] / "docs" / "drawings"
_CAMERA: dict[str, Any] = {
    "rotation": [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]],
    "translation": [0.0, -2.25, 104.5],
    "focal": 1814.8,
    "size": [640, 640],
}
_VERTICES = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
_QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]], dtype=np.int32)
_TRIANGLES = np.concatenate([_QUADS[:, [0, 1, 2]], _QUADS[:, [0, 2, 3]]])


def make_seeds(folder: Path) -> dict[str, list[Path]]:
    """Write the seeds to ``folder`` and return them by kind."""
    model = load_model("low")
    folder.mkdir(parents=True, exist_ok=True)
    made: dict[str, list[Path]] = {}
    for kind, files in _files(folder, model).items():
        made[kind] = []
        for name, content in files.items():
            path = folder / name
            if content is not None:
                path.write_bytes(content if isinstance(content, bytes) else json.dumps(content).encode())
            made[kind].append(path)
    return made


def _files(folder: Path, model: FaceModel) -> dict[str, dict[str, Any]]:
    """Return the files by kind and name; a content of None is already written."""
    performance = Performance.from_weights(model, _weights(model, 12), 30.0)
    write_live_link(folder / "live.csv", model, performance)
    write_weights(folder / "weights.json", model, performance)
    save_character(folder / "character.npz", model.character)
    session = _session(folder, model)
    points = [
        ("8.3", 300.0, 330.0),
        ("8.4", 340.0, 330.0),
        ("3.7", 350.0, 250.0),
        ("3.12", 290.0, 250.0),
        ("2.1", 320.0, 390.0),
    ]
    pins = [{"point": name, "pixel": [u, v]} for name, u, v in points]
    header = {"version": 1}
    return {
        "session": {
            "session.json": session,
            "plain.json": {
                "format": "faceposer.session",
                "version": 1,
                "subject": "low",
                "constraints": _constraints(),
            },
            "head.json": {
                "format": "faceposer.session",
                "version": 1,
                "subject": "man",
                "constraints": [],
                "identity": _identity(),
            },
        },
        "journal": {
            "journal.json": header
            | {
                "format": "faceposer.autosave",
                "path": None,
                "saved_at": "2026-01-02T03:04:05+00:00",
                "session": session,
            }
        },
        "settings": {
            "window.json": {
                "navigation": "blender",
                "window_size": [1360, 860],
                "window_position": [10, 20],
                "folder": "/tmp",
                "welcome_done": True,
                "ui_scale": 1.5,
                "keys": {"undo": ["Ctrl+Z"]},
                "recent": ["/tmp/a.json"],
                "characters": ["/tmp/a.npz"],
            }
        },
        "pose": {
            "pose.json": Pose(
                "Smile", {"jawOpen": 0.5, "mouthSmileLeft": 0.7}, "low", ("expression",), "A note"
            ).to_json()
        },
        "weights": {"weights.json": None},
        "live link": {"live.csv": None},
        "face cap": {"cap.txt": _face_cap()},
        "trajectories": {"trajectories.json": _trajectories(), "pixels.csv": _pixel_table()},
        "camera": {"camera.json": _CAMERA, "view.json": {"view": "front", "size": [640, 480]}},
        "pins": {"pins.json": header | {"format": "faceposer.pins", "pins": pins}},
        "strokes": {"strokes.json": _strokes()},
        "drawing": {f"{path.stem}.svg": path.read_bytes() for path in sorted(_DRAWINGS.glob("*.svg"))},
        "marker map": {
            "map.json": header
            | {
                "format": "faceposer.marker-map",
                "markers": {
                    "a": {"vertex": 3},
                    "b": {"feature": "8.3"},
                    "c": {"position": [0.0, 0.0, 9.0]},
                    "d": {"vertex": 9},
                },
                "fixed": ["a", "b", "d"],
                "neutral_frame": 1,
            }
        },
        "markers": {"markers.csv": _marker_table(), "nexus.csv": _nexus(), "motive.csv": _motive()},
        "c3d": {"markers.c3d": _c3d()},
        "character": {"character.npz": None},
        "examples": {"examples.npz": _examples()},
        "statistics": {"statistics.npz": _statistics(folder, model)},
        "obj": {"mesh.obj": _obj(folder), "plain.obj": _plain_obj()},
        "mtl": {
            "mesh.mtl": b"newmtl skin\nKd 0.8 0.5 0.4\nNs 10\nd 1\nmap_Kd skin.png\n\nnewmtl eye\nKd 1 1 1\nTr 0.1\n"
        },
        "ply": {"binary.ply": _ply(folder), "text.ply": _text_ply()},
        "off": {"mesh.off": _off()},
        "stl": {"mesh.stl": _stl(), "text.stl": _text_stl()},
        "shape folder": {"jawOpen.obj": _plain_obj().replace(b"v 0", b"v 0.25")},
        "gltf": {"face.glb": _gltf(vrm=False), "avatar.vrm": _gltf(vrm=True)},
        "gltf weights": {"weights.glb": _gltf(vrm=False)},
        "image": _images(),
    }


def _weights(model: FaceModel, frames: int) -> Any:
    rng = np.random.default_rng(0)
    return np.round(rng.uniform(0.0, 0.6, (frames, len(model.character.shape_names))), 3)


def _identity() -> dict[str, Any]:
    detail = np.zeros((head_template().n_control, 3))
    detail[::50, 2] = 0.01
    layers = SkinLayers(hair="short", brow_colour=(0.1, 0.2, 0.3))
    shape = np.random.default_rng(0).standard_normal((4, 100)).round(3)
    return Identity.of(shape, detail, SkinTexture((0.5, -0.25, *6 * (0.0,)), layers, eyes=(0.3, 0.2, 0.1))).to_json()


def _constraints() -> list[dict[str, Any]]:
    path, near = [[300.0, 372.0], [320.0, 374.0], [340.0, 372.0]], [[300.0, 376.0], [320.0, 378.0], [340.0, 376.0]]
    return [
        {
            "type": "point",
            "anchor": {"vertex": 120},
            "target": [310.0, 330.5],
            "camera": _CAMERA,
            "weight": 1.0,
            "enabled": True,
        },
        {
            "type": "point",
            "anchor": {"face": 30, "barycentric": [0.2, 0.5, 0.3]},
            "target": [330.0, 330.5],
            "camera": _CAMERA,
        },
        {"type": "distance", "anchors": [{"vertex": 5}, {"vertex": 90}], "target": 25.0, "camera": _CAMERA},
        {
            "type": "stroke",
            "source": path,
            "target": near,
            "width": 6.0,
            "camera": _CAMERA,
            "shape": "line",
            "energy": "distance",
        },
        {
            "type": "stroke",
            "source": {"anchors": [{"vertex": v} for v in range(8)]},
            "target": near,
            "width": 3,
            "camera": _CAMERA,
            "shape": "filled",
            "energy": "image",
        },
        {"type": "curve", "source": path, "target": near, "camera": _CAMERA},
        {"type": "fixed", "anchors": [{"vertex": 40}, {"vertex": 41}]},
        {"type": "gaze", "direction": [5.0, -3.0]},
        {
            "type": "sketch",
            "stroke": path,
            "camera": _CAMERA,
            "feature": "outer lower lip",
            "points": [{"feature_point": "8.4", "pixel": path[0]}, {"feature_point": "8.3", "pixel": path[2]}],
        },
        {
            "type": "sketch",
            "stroke": near,
            "camera": _CAMERA,
            "feature": "mouth outline",
            "points": [{"feature_point": "8.2", "pixel": near[1]}],
            "weight": 0.5,
        },
    ]


def _strokes() -> Any:
    lip = [[300.0 + 4.0 * i, 372.0 + 0.2 * i] for i in range(10)]
    return {
        "format": "faceposer.strokes",
        "version": 1,
        "camera": {"view": "front", "size": [640, 640]},
        "strokes": [{"pixels": lip, "feature": None}, {"pixels": lip[::3], "feature": "outer lower lip"}],
    }


def _session(folder: Path, model: FaceModel) -> Any:
    """Return a session with everything that one may contain."""
    keys = [{"frame": frame, "coefficients": (0.1 * model.neutral() + 0.01 * frame).tolist()} for frame in (0, 9)]
    data = {
        "format": "faceposer.session",
        "version": 1,
        "subject": "low",
        "prior_weight": 1.0,
        "spread": 0.4,
        "sketch_method": "map",
        "prior": "regions",
        "constraints": _constraints(),
        "start": (0.02 + model.neutral()).tolist(),
        "coefficients": (0.05 + model.neutral()).tolist(),
        "contact": True,
        "camera": _CAMERA,
        "photos": [{"path": "a.png", "size": [64, 48], "pins": [{"point": "8.3", "pixel": [3, 4]}], "opacity": 0.5}],
        "animation": {
            "frame": 3,
            "rate": 30.0,
            "length": 20,
            "loop": False,
            "inbetweens": "feature points",
            "keys": keys,
        },
    }
    document = Document.from_json(data).resolved(model)
    write_document(folder / "stamped.json", document.with_version_data(model))
    return json.loads((folder / "stamped.json").read_text())


def _face_cap() -> bytes:
    rows = ["info, a take", "bs,browInnerUp,jawOpen,eyeBlink_L"]
    rows += [f"k,{40 * i}{',0.1' * 10},0.{i},0.2,0.3" for i in range(8)]
    return "\n".join(rows).encode()


def _trajectories() -> Any:
    positions = [[300.0 + i, 330.0] if i != 2 else None for i in range(6)]
    return {
        "format": "faceposer.trajectories",
        "version": 1,
        "rate": 25.0,
        "camera": _CAMERA,
        "points": [
            {"name": "8.3", "positions": positions, "weight": 1.0},
            {"name": "lip", "anchor": {"vertex": 7}, "positions": positions},
        ],
    }


def _pixel_table() -> bytes:
    rows = ["time,8.3.x,8.3.y,8.4.x,8.4.y"] + [f"{i / 25:.3f},{300 + i},330,{340 + i},331" for i in range(6)]
    return "\n".join(rows).encode()


def _marker_table() -> bytes:
    rows = ["time," + ",".join(f"{name}.{axis}" for name in "abc" for axis in "xyz")]
    rows += [f"{i / 100:.3f}," + ",".join(f"{k + 0.1 * i:.2f}" for k in range(9)) for i in range(6)]
    return "\n".join(rows).encode()


def _nexus() -> bytes:
    rows = ["Trajectories", "100", ",,p:a,,,p:b,,", "Frame,Sub Frame,X,Y,Z,X,Y,Z", ",,mm,mm,mm,mm,mm,mm"]
    rows += [f"{i},0,1.0,2.0,3.{i},4.0,5.0,6.0" for i in range(1, 5)]
    return "\n".join(rows).encode()


def _motive() -> bytes:
    rows = [
        "Format Version,1.23,Take Name,a,Export Frame Rate,120,Length Units,Millimeters",
        "",
        ",Type,Marker,Marker,Marker",
    ]
    rows += [",Name,p:a,p:a,p:a", ",ID,1,1,1", ",,Position,Position,Position", "Frame,Time (Seconds),X,Y,Z"]
    rows += [f"{i},{i / 120:.4f},1.0,2.0,3.{i}" for i in range(4)]
    return "\n".join(rows).encode()


def _c3d() -> bytes:
    writer = c3d.Writer(point_rate=120.0, analog_rate=0.0)
    writer.set_point_labels(["a", "b", "c"])
    rng = np.random.default_rng(0)
    writer.add_frames(
        [
            (np.hstack([rng.uniform(1, 9, (3, 3)), np.zeros((3, 2))]).astype(np.float32), np.zeros((0, 0)))
            for _ in range(6)
        ]
    )
    stream = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        writer.write(stream)
    return stream.getvalue()


def _examples() -> bytes:
    stream = io.BytesIO()
    frames = np.stack([_VERTICES + 0.1 * k for k in range(4)]).astype(np.float32)
    np.savez(stream, vertices=frames, faces=_TRIANGLES)
    return stream.getvalue()


def _statistics(folder: Path, model: FaceModel) -> bytes:
    from faceposer.model.expression_statistics import load_expression_statistics

    load_expression_statistics().save(folder / "own.npz")
    return (folder / "own.npz").read_bytes()


def _obj(folder: Path) -> bytes:
    path = folder / "mesh.obj"
    groups = (Group("head", (0, 3), "skin"), Group("eye", (3, 6), "eye"))
    uv = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    write_obj(path, _VERTICES, _QUADS, uv, np.tile(np.arange(4), (6, 1)), _VERTICES - 0.5, groups, "a cube")
    return b"mtllib mesh.mtl\n" + path.read_bytes()


def _plain_obj() -> bytes:
    rows = [f"v {x:g} {y:g} {z:g}" for x, y, z in _VERTICES] + [
        "f " + " ".join(str(v + 1) for v in quad) for quad in _QUADS
    ]
    return ("\n".join(rows) + "\n").encode()


def _ply(folder: Path) -> bytes:
    path = folder / "made.ply"
    write_ply(path, _VERTICES, _QUADS, _VERTICES - 0.5, "a cube")
    return path.read_bytes()


def _text_ply() -> bytes:
    rows = ["ply", "format ascii 1.0", "element vertex 8", *(f"property float {axis}" for axis in "xyz")]
    rows += ["element face 6", "property list uchar int vertex_indices", "end_header"]
    rows += [f"{x:g} {y:g} {z:g}" for x, y, z in _VERTICES] + [
        "4 " + " ".join(map(str, quad)) for quad in _QUADS.tolist()
    ]
    return ("\n".join(rows) + "\n").encode()


def _off() -> bytes:
    rows = [
        "OFF",
        "8 6 0",
        *(f"{x:g} {y:g} {z:g}" for x, y, z in _VERTICES),
        *("4 " + " ".join(map(str, quad)) for quad in _QUADS.tolist()),
    ]
    return ("\n".join(rows) + "\n").encode()


def _stl() -> bytes:
    rows = np.zeros(len(_TRIANGLES), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")])
    rows["corners"] = _VERTICES[_TRIANGLES]
    return bytes(80) + np.uint32(len(rows)).tobytes() + rows.tobytes()


def _text_stl() -> bytes:
    rows = ["solid a"]
    for corners in _VERTICES[_TRIANGLES].tolist():
        rows += [
            "facet normal 0 0 1",
            "outer loop",
            *(f"vertex {x:g} {y:g} {z:g}" for x, y, z in corners),
            "endloop",
            "endfacet",
        ]
    return "\n".join([*rows, "endsolid a", ""]).encode()


def _gltf(vrm: bool) -> bytes:
    """Return a face with two morph targets, a skin, a texture, and an animation of its weights."""
    builder = GltfBuilder({"generator": "fuzz"})
    points = (_VERTICES - 0.5).astype(np.float32)
    position = builder.accessor(points, "<f4", bounds=True)
    targets = [{"POSITION": builder.accessor(0.1 * np.roll(points, k, axis=0), "<f4", bounds=True)} for k in (1, 2)]
    attributes = {
        "POSITION": position,
        "TEXCOORD_0": builder.accessor(np.tile([0.25, 0.75], (8, 1)), "<f4"),
        "NORMAL": builder.accessor(points, "<f4"),
    }
    indices = builder.accessor(_TRIANGLES.reshape(-1), "<u2")
    image = builder.add("images", {"bufferView": builder.view(_images()["image.png"]), "mimeType": "image/png"})
    texture = builder.add("textures", {"source": image})
    material = builder.add(
        "materials", {"name": "skin", "pbrMetallicRoughness": {"baseColorTexture": {"index": texture}}}
    )
    primitive = {"attributes": attributes, "indices": indices, "targets": targets, "material": material}
    mesh = builder.add(
        "meshes",
        {
            "name": "head",
            "primitives": [primitive],
            "extras": {"targetNames": ["jawOpen", "mouthSmileLeft"]},
            "weights": [0.0, 0.5],
        },
    )
    node = builder.add(
        "nodes", {"name": "head", "mesh": mesh, "rotation": [0, 0, 0, 1], "scale": [1, 1, 1], "translation": [0, 1, 0]}
    )
    builder.add("nodes", {"name": "root", "children": [node]})
    builder.root |= {"scene": 0, "scenes": [{"nodes": [1]}]}
    times, values = (
        builder.accessor(np.arange(5) / 30.0, "<f4", bounds=True),
        builder.accessor(np.linspace(0, 1, 10), "<f4"),
    )
    sampler = {"input": times, "output": values, "interpolation": "LINEAR"}
    builder.add(
        "animations", {"samplers": [sampler], "channels": [{"sampler": 0, "target": {"node": node, "path": "weights"}}]}
    )
    if vrm:
        bind = {"node": node, "index": 0, "weight": 1.0}
        old = {"name": "A", "presetName": "a", "binds": [{"mesh": mesh, "index": 1, "weight": 100}]}
        builder.root["extensions"] = {
            "VRMC_vrm": {
                "expressions": {
                    "preset": {"aa": {"morphTargetBinds": [bind]}},
                    "custom": {"JawOpen": {"morphTargetBinds": [bind]}},
                }
            },
            "VRM": {"blendShapeMaster": {"blendShapeGroups": [old]}},
        }
    return builder.to_bytes()


def _images() -> dict[str, bytes]:
    rng = np.random.default_rng(0)
    picture = Image.fromarray(rng.integers(0, 255, (24, 32, 3), dtype=np.uint8))
    exif = Image.Exif()
    exif[0x0112] = 6
    result = {}
    for suffix, options in (("png", {}), ("jpg", {"exif": exif}), ("tif", {"exif": exif}), ("bmp", {}), ("webp", {})):
        stream = io.BytesIO()
        picture.save(stream, "JPEG" if suffix == "jpg" else "TIFF" if suffix == "tif" else suffix.upper(), **options)
        result[f"image.{suffix}"] = stream.getvalue()
    return result
