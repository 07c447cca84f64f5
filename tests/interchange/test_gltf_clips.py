"""Animations of a glTF file for several meshes are merged; what disagrees or is not read is said."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from faceposer.training.gltf_weights import read_gltf_weights
from tests.geometry.test_gltf_io import FROWN, POINTS, SMILE, Builder

NAMES = ["jawOpen", "tongueOut"]


def clip(builder: Builder, name: str, node: int, times: list[float], weights: list[list[float]]) -> dict[str, Any]:
    sampler = {
        "input": builder.accessor(np.array(times, dtype="<f4")),
        "output": builder.accessor(np.array(weights, dtype="<f4").ravel()),
    }
    channel = {"sampler": 0, "target": {"node": node, "path": "weights"}}
    return {"name": name, "samplers": [sampler], "channels": [channel]}


def head_and_tongue() -> Builder:
    builder = Builder()
    for name in ("head", "tongue"):
        mesh = builder.mesh(builder.primitive(POINTS, targets=(SMILE, FROWN)), names=NAMES)
        builder.node(mesh=mesh, name=name)
    return builder


def write(builder: Builder, path: Path, *clips: dict[str, Any]) -> Path:
    builder.json["animations"] = list(clips)
    return builder.write(path)


KEYS = "Its keys are 1 s apart; they were interpolated at 30 frames per second."
RISING, RESTING, TONGUE = [[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 1.0]]


def test_clips_of_one_time_span_are_merged(tmp_path: Path) -> None:
    builder = head_and_tongue()
    tongue = clip(builder, "TongueAction", 1, [0.0, 1.0], TONGUE)
    head = clip(builder, "HeadAction", 0, [0.0, 1.0], RISING)
    read = read_gltf_weights(write(builder, tmp_path / "a.glb", tongue, head))
    assert read.names == ("jawOpen", "tongueOut")
    np.testing.assert_allclose(read.frames[[0, -1]], [[0, 0], [1, 1]])
    assert read.notes[0] == "The animations 'TongueAction', 'HeadAction' of different meshes were merged."
    assert read.notes[1].startswith(
        "2 shapes have different weights in several meshes (such as 'jawOpen' in 'head' and"
    )


@pytest.mark.parametrize(
    ("node", "times", "merged"),
    [(1, [0.1, 0.9], True), (1, [0.0, 1.4], True), (1, [5.0, 6.0], False), (0, [0.0, 1.0], False)],
)
def test_clips_of_other_times_or_of_the_same_mesh_are_not(
    node: int, times: list[float], merged: bool, tmp_path: Path
) -> None:
    builder = head_and_tongue()
    first = clip(builder, "one", 0, [0.0, 0.5, 1.0], [[0.0, 0.0], [0.5, 0.0], [1.0, 0.0]])
    read = read_gltf_weights(write(builder, tmp_path / "a.glb", first, clip(builder, "two", node, times, TONGUE)))
    assert bool(read.frames[:, 1].any()) == merged
    assert ("were merged" in read.notes[0]) == merged
    if not merged:
        assert read.notes[0] == "1 further animation was not read: 'two'."


def test_channels_that_are_not_read_are_counted(tmp_path: Path) -> None:
    builder = head_and_tongue()
    action = clip(builder, "one", 0, [0.0, 1.0], RISING)
    for kind in ("rotation", "rotation", "translation", "pointer"):
        action["channels"].append({"sampler": 0, "target": {"node": 1, "path": kind}})
    read = read_gltf_weights(write(builder, tmp_path / "a.glb", action))
    said = "4 channels that move no named morph target (1 other, 2 rotation, 1 translation) were not read."
    assert read.notes[0] == said
    del action["channels"][2:]
    read = read_gltf_weights(write(builder, tmp_path / "b.glb", action))
    assert read.notes[0] == "1 channel that moves no named morph target (1 rotation) was not read."


def test_meshes_that_agree_need_no_remark(tmp_path: Path) -> None:
    builder = head_and_tongue()
    both = clip(builder, "all", 0, [0.0, 1.0], RISING)
    both["channels"].append({"sampler": 0, "target": {"node": 1, "path": "weights"}})
    assert read_gltf_weights(write(builder, tmp_path / "a.glb", both)).notes == (KEYS,)
    still = head_and_tongue()
    still.json["meshes"][1]["weights"] = [0.0, 0.7]
    read = read_gltf_weights(still.write(tmp_path / "b.glb"))
    np.testing.assert_allclose(read.frames, [[0.0, 0.7]])
    assert "1 shape has different weights" in read.notes[0]
