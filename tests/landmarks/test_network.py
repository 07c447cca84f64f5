"""The networks are those of MediaPipe, and their file is checked."""

import importlib.util
import json
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.landmarks.network import load_networks, networks
from faceposer.landmarks.reference import load_reference, reference
from faceposer.resources import asset_path
from scripts.build_landmarks import FILES, ROOT, WHEEL_NAME, build_networks, differences, read_wheel
from tests.landmarks.litert import OUTPUTS, image_for, kept, litert_outputs

SIDES = {"detection": 128, "points": 192, "iris": 64}


def wheel() -> Path | None:
    """Return the wheel of MediaPipe, if there is one."""
    places = [os.environ.get("FACEPOSER_MEDIAPIPE_WHEEL"), ROOT / "build" / "source" / WHEEL_NAME]
    return next((Path(place) for place in places if place and Path(place).is_file()), None)


def test_outputs_have_their_shapes_and_inputs_are_checked() -> None:
    sizes = {"detection": [(896, 16), (896, 1)], "points": [(1, 1, 1404), (1, 1, 1)], "iris": [(213,), (15,)]}
    for name, network in networks().items():
        assert network.side == SIDES[name]
        outputs = network(np.zeros((network.side, network.side, 3), dtype=np.float32))
        assert [output.shape for output in outputs] == sizes[name]
        assert all(np.isfinite(output).all() for output in outputs)
        with pytest.raises(ValueError, match="shape"):
            network(np.zeros((network.side, network.side, 4), dtype=np.float32))


def assert_agreement(name: str, theirs: Sequence[NDArray[np.float32]]) -> None:
    """Assert that the network ``name`` gives the outputs ``theirs`` of LiteRT, or the rows of them that are kept."""
    network = networks()[name]
    for ours, known in zip(network(image_for(name, network.side)), theirs, strict=True):
        # Places are in pixels of the input; the iris network loses a little by half precision.
        assert np.abs(kept(ours).ravel() - kept(known).ravel()).max() < 1e-3 * (network.side if name == "iris" else 1.0)


@pytest.mark.parametrize("name", list(SIDES))
def test_networks_agree_with_kept_outputs_of_litert(name: str) -> None:
    with np.load(OUTPUTS, allow_pickle=False) as outputs:
        assert_agreement(name, [outputs[f"{name}.{i}"] for i in range(2)])


@pytest.mark.parametrize("name", list(SIDES))
def test_networks_agree_with_litert(name: str) -> None:
    source = wheel()
    if source is None or importlib.util.find_spec("ai_edge_litert") is None:
        pytest.skip("needs ai-edge-litert and the wheel of mediapipe, as scripts/build_landmarks.py downloads it")
    assert_agreement(name, litert_outputs(read_wheel(source)[name], name))


def test_the_file_is_as_built() -> None:
    source = wheel()
    if source is None:
        pytest.skip("needs the wheel of mediapipe, as scripts/build_landmarks.py downloads it")
    members = build_networks(read_wheel(source))
    assert differences(members, asset_path("landmarks.npz")) == ["mirror", "normals", "reference"]


def test_the_licence_and_credits_ship() -> None:
    text = asset_path("licences/landmarks-MediaPipe-Apache-2.0.txt").read_text(encoding="utf-8")
    assert "Apache License" in text
    with np.load(asset_path("landmarks.npz"), allow_pickle=False) as members:
        meta = json.loads(bytes(members["meta"]))
    assert "MediaPipe" in meta["credits"]
    assert set(FILES) == set(meta["networks"]) == set(SIDES)
    assert asset_path("landmarks.npz").stat().st_size < 5e6


def test_reference_is_symmetric() -> None:
    known = reference()
    mirrored = known.places[known.mirror] * (-1.0, 1.0, 1.0)
    np.testing.assert_allclose(mirrored, known.places, atol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(known.normals, axis=1), 1.0, atol=1e-4)


@pytest.mark.parametrize("damage", ["empty", "cut", "text", "format", "missing"])
def test_damaged_files_get_one_sentence(tmp_path: Path, damage: str) -> None:
    path, data = tmp_path / "landmarks.npz", asset_path("landmarks.npz").read_bytes()
    if damage == "format":
        np.savez(path, meta=np.frombuffer(b'{"format": "other"}', dtype=np.uint8))
    elif damage != "missing":
        path.write_bytes({"empty": b"", "cut": data[:100_000], "text": b"hello"}[damage])
    for load in (load_networks, load_reference):
        with pytest.raises(FacePoserError, match="install Face Poser again"):
            load(path)
