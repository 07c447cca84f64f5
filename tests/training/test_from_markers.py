"""Markers move a scan, and the scan's frames become a character."""

import json
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.model.face_model import build_face_model
from faceposer.training.examples import ExampleOptions
from faceposer.training.from_markers import character_from_markers
from faceposer.training.summary import text_of_summary
from tests.training.faces import BASE, base, poses

OPTIONS = ExampleOptions("me", "Me")
NAMES = ("8.3", "8.4", "8.1", "8.2", "2.1", "4.1", "4.2", "4.3", "4.4", "4.5", "4.6", "5.1", "5.2", "9.3", "11.1")


def write_markers(folder: Path, frames: int = 24) -> tuple[Path, Path]:
    """A performance of the head's own feature points, in millimetres and with the head moving."""
    face = base()
    vertices = [face.feature_points[name] for name in NAMES]
    rng = np.random.default_rng(5)
    rows = ["frame," + ",".join(f"M{i}.{axis}" for i in range(len(NAMES)) for axis in "xyz")]
    for frame, pose in enumerate([face.vertices, *poses(frames - 1, seed=3)]):
        moved = 10.0 * pose[vertices] + (5.0 * rng.standard_normal(3) if frame else 0.0)
        rows.append(f"{frame}," + ",".join(f"{value:.4f}" for value in moved.ravel()))
    motion, marker_map = folder / "take.csv", folder / "map.json"
    motion.write_text("\n".join(rows) + "\n")
    places = {f"M{i}": {"feature": name} for i, name in enumerate(NAMES)}
    content = {"format": "faceposer.marker-map", "version": 1, "markers": places, "fixed": ["M14", "M11", "M12"]}
    marker_map.write_text(json.dumps(content))
    return motion, marker_map


def test_a_performance_of_markers_becomes_a_character_with_the_scans_landmarks(tmp_path: Path) -> None:
    motion, marker_map = write_markers(tmp_path)
    character = character_from_markers(motion, marker_map, BASE, OPTIONS)
    face = base()
    np.testing.assert_array_equal(character.vertices, face.vertices)
    assert character.feature_points == face.feature_points
    assert character.parts == face.parts
    assert character.textures.keys() == face.textures.keys()
    assert character.summary["kind"] == "markers"
    assert character.summary["markers"]["frames"] == 24
    assert character.summary["markers"]["frames_left_out"] == 0
    model = build_face_model(character)
    # A smile that the markers never made is still within what they taught the corners to do.
    corner = face.feature_points["8.3"]
    reach = np.linalg.norm(model.basis.reshape(model.n_coefficients, -1, 3)[:, corner], axis=0)
    assert reach.min() > 0.0


def test_missing_frames_are_in_the_summary(tmp_path: Path) -> None:
    motion, marker_map = write_markers(tmp_path, 16)
    lines = motion.read_text().splitlines()
    motion.write_text("\n".join(lines[:5] + lines[8:]))
    character = character_from_markers(motion, marker_map, BASE, OPTIONS)
    assert "3 of its 16 frames are missing" in " ".join(character.summary["warnings"])
    assert "3 of its 16 frames are missing" in text_of_summary(character)


def test_maps_that_do_not_fit_are_named(tmp_path: Path) -> None:
    motion, marker_map = write_markers(tmp_path, 6)
    content = json.loads(marker_map.read_text())
    content["markers"]["Ghost"] = {"vertex": 3}
    marker_map.write_text(json.dumps(content))
    with pytest.raises(FacePoserError, match=r"map\.json' has marker Ghost, which is not in the motion"):
        character_from_markers(motion, marker_map, BASE, OPTIONS)
    with pytest.raises(FacePoserError, match="no character 'nobody'"):
        character_from_markers(motion, marker_map, "nobody", OPTIONS)
