#!/usr/bin/env python3
"""Make the images of the window with an animation, the export dialog, the pose library and key poses.

    python scripts/window_pictures.py

The images timeline.jpg, export.jpg, film.jpg, pose-library.jpg and key-poses.jpg are written to docs/images.

A scripted user operates the real program without a display: it draws three paths over the woman's face, solves for the
animation and exports it as a video.
"""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image, ImageSequence

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.animation.keyframes import Keyframes
from faceposer.gui.app import App
from faceposer.gui.features.export.feature import ExportFeature
from faceposer.gui.features.keys.feature import KeysFeature
from faceposer.gui.features.timeline.feature import TimelineFeature
from faceposer.gui.features.trajectories.feature import TrajectoriesFeature
from faceposer.gui.settings import Settings
from faceposer.gui.testing.scripted_user import Robot
from faceposer.session.key_proposals import create_keys

WINDOW, KEYS_WINDOW = (1280, 820), (1280, 900)
LEFT_CORNER, RIGHT_CORNER, CHIN = "8.3", "8.4", "2.1"
VIDEO_FRAMES = 6
# Weights of the man at key frames; the sneer and the puffed cheeks are in no key pose.
ANIMATION: dict[int, dict[str, float]] = {
    0: {},
    30: {"mouthSmileLeft": 0.8, "mouthSmileRight": 0.8, "cheekSquintLeft": 0.5, "cheekSquintRight": 0.5},
    60: {"jawOpen": 0.5, "browInnerUp": 0.8, "eyeWideLeft": 0.6, "eyeWideRight": 0.6},
    90: {"cheekPuff": 0.8, "noseSneerLeft": 0.7, "mouthLeft": 0.5},
    120: {},
}


def draw_smile(robot: Robot) -> None:
    """Draw paths of the corners of the mouth and of the chin, and solve for the animation."""
    trajectories = robot.app.features[TrajectoriesFeature]
    robot.key("J")
    for feature, across, down in ((LEFT_CORNER, 20, -18), (RIGHT_CORNER, -20, -18), (CHIN, 0, 12)):
        x, y = robot.at(feature)
        robot.drag((x, y), (x + across, y + down), steps=36, ease=True)
    robot.key("Enter")
    while trajectories.job is not None:
        trajectories.job.join()
        robot.frames()


def save_window(robot: Robot, path: Path) -> None:
    """Write a screenshot of the window to ``path``."""
    robot.frames(3)
    Image.fromarray(robot.app.screenshot()).save(path, quality=88)
    print(path)


def save_video(robot: Robot, folder: Path, path: Path) -> None:
    """Export the animation with the dialog and write some of its frames side by side to ``path``."""
    export = robot.app.features[ExportFeature]
    export.form.width = export.form.height = 360
    robot.click_widget("export:accept")
    robot.key("Ctrl+A")
    robot.type("smile")
    robot.click_widget("files:accept")
    while export.job is not None:
        robot.frames()
    with Image.open(folder / "smile.gif") as video:
        frames = [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(video)]
    chosen = np.linspace(0, len(frames) - 1, VIDEO_FRAMES).round().astype(int)
    Image.fromarray(np.hstack([frames[i] for i in chosen])).save(path, quality=88)
    print(path)


def save_key_poses(folder: Path, path: Path) -> None:
    """Write an image of the window with key poses of man and goblin, and an animation that they cover in part."""
    keys = create_keys(folder / "man-goblin", "man", "creature")
    settings = Settings(window_size=KEYS_WINDOW, folder=str(folder), keys_folder=str(keys.folder), welcome_done=True)
    app = App("man", hidden=True, threaded=False, settings=settings)
    robot = Robot(app)
    model = app.session.model
    keyframes = Keyframes(length=max(ANIMATION) + 1)
    for frame, weights in ANIMATION.items():
        keyframes = keyframes.with_key(frame, model.coefficients_of(weights))
    timeline = app.features[TimelineFeature]
    timeline.change(keyframes, "Animation")
    timeline.go_to(30)
    feature = app.features[KeysFeature]
    app.actions["key-poses"].run()
    while feature.opened.reading or feature.faces.waiting or feature.opened.keys is None:
        feature.join()
        robot.frames()
    robot.frames(40)
    save_window(robot, path)
    app.close()


def main() -> None:
    """Make all images."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        default=ROOT / "docs" / "images",
        metavar="DIR",
        help="folder (default: docs/images)",
    )
    output = parser.parse_args().output
    with tempfile.TemporaryDirectory() as folder:
        settings = Settings(window_size=WINDOW, folder=folder, welcome_done=True)
        app = App("woman", hidden=True, threaded=False, settings=settings)
        robot = Robot(app)
        draw_smile(robot)
        timeline = app.features[TimelineFeature]
        robot.click(timeline.track.ruler_place(timeline.keyframes.length - 1))
        save_window(robot, output / "timeline.jpg")
        robot.key("P")
        app.actions["export-other"].run()
        robot.frames(6)
        robot.click_widget("export:gif")
        save_window(robot, output / "export.jpg")
        save_video(robot, Path(folder), output / "film.jpg")
        robot.key("P")
        robot.key("Q")
        robot.click_widget("tab:Poses")
        robot.move((600.0, 660.0))
        robot.frames(90)
        save_window(robot, output / "pose-library.jpg")
        app.close()
        save_key_poses(Path(folder), output / "key-poses.jpg")


if __name__ == "__main__":
    main()
