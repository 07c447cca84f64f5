"""Draw ``docs/images/heads.jpg``: random people of the morphable model, and one of them in six expressions.

Run from the root of a checkout::

    python -m scripts.head_gallery
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.geometry.camera import Camera, OrbitView
from faceposer.identity.editing import head_editor
from faceposer.model.character import Character
from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.poses.applying import weights_on
from faceposer.poses.library import starter_poses
from faceposer.render.offscreen import render_character

_SEEDS, _SPREAD, _WIDTH, _HEIGHT = range(1, 13), 0.85, 300, 360
_QUALITY = 88


def person(seed: int) -> Character:
    """Return a random person with a skin, hair and eyes that fit."""
    editor = head_editor(load_character("man"))
    head = editor.random(seed, spread=_SPREAD)
    return editor.with_head(replace(head, texture=editor.random_texture(seed, head)))


def _camera(character: Character, yaw: float) -> Camera:
    middle = character.vertices[character.regions["nose"]].mean(axis=0)
    return OrbitView((0.0, float(middle[1]) + 1.0, float(middle[2]) - 6.0), yaw, 0.0, distance=75.0).camera(
        (_WIDTH, _HEIGHT)
    )


def _expressions(model: FaceModel) -> list[NDArray[np.uint8]]:
    entries = [entry for entry in starter_poses() if entry.pose is not None and "expression" in entry.pose.tags]
    drawn = []
    for entry in entries[:6]:
        assert entry.pose is not None
        weights = weights_on(entry.pose, model.character)
        assert weights is not None
        surface = model.surface(model.coefficients_of(weights))
        drawn.append(render_character(model.character, surface, _camera(model.character, 0.35)))
    return drawn


def main() -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, default=ROOT / "docs" / "images" / "heads.jpg", help="file to write")
    options = parser.parse_args()
    people = [person(seed) for seed in _SEEDS]
    cells = [render_character(one, one.vertices, _camera(one, 0.35 * (-1) ** i)) for i, one in enumerate(people)]
    cells += _expressions(build_face_model(load_character("amara")))
    rows = [np.hstack(cells[i : i + 6]) for i in range(0, len(cells), 6)]
    Image.fromarray(np.vstack(rows)).save(options.output, "JPEG", quality=_QUALITY)
    print(options.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
