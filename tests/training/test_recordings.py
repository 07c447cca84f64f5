"""Performances of every format can be learned from, by one reader."""

import json
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.interchange.glb import write_glb
from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.performance import Performance
from faceposer.training.recordings import read_named, read_recording


@pytest.fixture(scope="module")
def low() -> FaceModel:
    return build_face_model(load_character("low"))


def test_tables_json_and_gltf_are_the_same_take(low: FaceModel, tmp_path: Path) -> None:
    names = ("jawOpen", "mouthFunnel", "cheekPuff")
    weights = 0.5 + 0.4 * np.sin(np.arange(40)[:, None] * np.array([0.1, 0.2, 0.3]))
    rows = [",".join([f"{i / 25:.2f}", *(f"{value:.6f}" for value in row)]) for i, row in enumerate(weights)]
    (tmp_path / "a.csv").write_text("\n".join([",".join(("time", *names)), *rows]))
    frames = [dict(zip(names, row, strict=True)) for row in weights.tolist()]
    (tmp_path / "b.json").write_text(json.dumps({"fps": 25, "frames": frames}))
    poses = np.array([low.coefficients_of(frame) for frame in frames])
    write_glb(tmp_path / "c.glb", low, Performance(poses, 25.0))
    for name in ("a.csv", "b.json", "c.glb"):
        capture = read_recording(tmp_path / name).with_shapes(names)
        np.testing.assert_allclose(capture.weights, weights, atol=2e-3)
        assert read_named(tmp_path / name).rate == pytest.approx(25.0)


def test_files_without_shapes_of_arkit_are_refused(tmp_path: Path) -> None:
    data = {"format": "faceposer.weights", "version": 1, "names": ["hat"], "frames": [[0.5]]}
    (tmp_path / "a.json").write_text(json.dumps(data))
    with pytest.raises(FacePoserError, match="has no weights of ARKit's shapes"):
        read_recording(tmp_path / "a.json")
    with pytest.raises(FacePoserError, match="is not an animation"):
        read_named(tmp_path / "a.wav")
