#!/usr/bin/env python3
"""Make the animation at the top of the README: a scripted user poses a face, without a display.

    python scripts/readme_animation.py       # writes docs/images/posing.webp

The user drags the corners of the mouth and a brow, sketches the other brow, turns the eyes and orbits. The file is kept
under 2 MB; the script fails if it is larger.
"""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.gui.app import App
from faceposer.gui.settings import Settings
from faceposer.gui.testing.recorder import Recorder
from faceposer.gui.testing.scripted_user import Robot

WINDOW = (1200, 780)
WIDTH = 800
QUALITY = 70
FRAME_MILLISECONDS = 70
MAX_BYTES = 2_000_000
# MPEG-4 feature points.
LEFT_CORNER, RIGHT_CORNER = "8.3", "8.4"
LEFT_BROW = ("4.1", "4.3", "4.5")
RIGHT_BROW = ("4.2", "4.4", "4.6")
LEFT_PUPIL = "3.5"


class Script:
    """The actions of the user, each with its caption.

    Attributes:
        frames: Recorded images with the time that each is shown, in milliseconds.
    """

    def __init__(self, app: App, recorder: Recorder) -> None:
        """Operate ``app`` and record it with ``recorder``."""
        self._app = app
        self._recorder = recorder
        self._robot = Robot(app, lambda robot: recorder.take(robot.position, robot.pressed is not None))

    def play(self) -> None:
        """Play all actions."""
        robot = self._robot
        robot.move(self._view(0.8, 0.8))
        self._caption("Drag a point: the whole face follows", 6)
        self._pull(LEFT_CORNER, 15.0, -15.0)
        self._pull(RIGHT_CORNER, -13.0, -14.0)
        self._caption("Pins hold what was dragged", 2)
        self._pull(LEFT_BROW[1], 2.0, -10.0)
        self._caption("Sketch a brow, then its target", 2)
        robot.key("S")
        self._stroke(RIGHT_BROW, 0.0)
        self._stroke(RIGHT_BROW, -9.0)
        self._caption("Turn the eyes", 4)
        robot.key("G")
        self._pull(LEFT_PUPIL, 85.0, 22.0)
        self._caption("Orbit", 3)
        robot.key("Q")
        robot.key("Esc")
        self._orbit(-210.0, 14.0)
        self._orbit(150.0, -8.0)
        self._caption("Compare with the neutral face", 2)
        robot.key("C")
        self._recorder.hold(8)
        robot.key("C")
        self._recorder.hold(18)

    def _caption(self, text: str, hold: int) -> None:
        self._recorder.caption = text
        self._robot.frames()
        self._recorder.hold(hold)

    def _view(self, across: float, down: float) -> tuple[float, float]:
        """Return the position at fractions of the width and the height of the view."""
        left, top, right, bottom = self._app.widget_rects["view"]
        return (left + across * (right - left), top + down * (bottom - top))

    def _unit(self) -> float:
        """Return 1/450 of the head's height in the view, in pixels."""
        rows = self._app.viewport.camera.project(self._app.session.model.character.vertices)[:, 1]
        return float(rows.max() - rows.min()) / 450.0

    def _pull(self, feature: str, across: float, down: float) -> None:
        """Drag a feature point by multiples of ``_unit``."""
        robot, unit = self._robot, self._unit()
        x, y = robot.at(feature)
        robot.move((x, y), 5, ease=True)
        robot.press()
        robot.move((x + across * unit, y + down * unit), 10, ease=True)
        robot.release()
        self._recorder.hold(4)

    def _stroke(self, features: Sequence[str], down: float) -> None:
        """Draw along feature points, moved down by a multiple of ``_unit``."""
        robot, unit = self._robot, self._unit()
        first, *others = [(x, y + down * unit) for x, y in map(robot.at, features)]
        robot.move(first, 5, ease=True)
        robot.press()
        for position in others:
            robot.move(position, 4)
        robot.release()
        self._recorder.hold(4)

    def _orbit(self, across: float, down: float) -> None:
        robot = self._robot
        x, y = self._view(0.15 if across > 0 else 0.85, 0.8)
        robot.move((x, y), 4, ease=True)
        robot.press()
        robot.move((x + across, y + down), 14, ease=True)
        robot.release()
        self._recorder.hold(2)


def main() -> None:
    """Make the animation."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = ROOT / "docs" / "images" / "posing.webp"
    parser.add_argument("-o", "--output", type=Path, default=default, help="file to write (default: %(default)s)")
    output = parser.parse_args().output
    app = App("man", hidden=True, threaded=False, settings=Settings(window_size=WINDOW, welcome_done=True))
    with tempfile.TemporaryDirectory() as folder:
        try:
            recorder = Recorder(app.screenshot, Path(folder))
            Script(app, recorder).play()
        finally:
            app.close()
        images = [image.convert("RGB") for image in map(Image.open, recorder.frames)]
    height = round(WINDOW[1] * WIDTH / WINDOW[0])
    first, *others = [image.resize((WIDTH, height), Image.Resampling.LANCZOS) for image in images]
    durations = [round(time * FRAME_MILLISECONDS / 80) for time in recorder.milliseconds]
    first.save(output, save_all=True, append_images=others, duration=durations, loop=0, quality=QUALITY, method=6)
    size = output.stat().st_size
    print(f"{output}: {len(images)} frames, {sum(durations) / 1000.0:.1f} s, {size / 1e6:.2f} MB")
    if size > MAX_BYTES:
        sys.exit(f"{output} is larger than {MAX_BYTES / 1e6:.0f} MB; lower QUALITY or WIDTH.")


if __name__ == "__main__":
    main()
