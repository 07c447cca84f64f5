#!/usr/bin/env python3
"""Make the images of the gallery with the program on a virtual display, operated by pointer and keys.

    python scripts/gallery.py                 # images into docs/images
    python scripts/gallery.py --only sneer    # one of them

Every event is sent to two programs: to the real one, by xdotool, on a virtual display; and to a second, hidden one,
which provides the current positions of widgets and features of the face. The images show the real one.
"""

import argparse
import contextlib
import itertools
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from faceposer.gui.app import App
from faceposer.gui.settings import Settings
from faceposer.gui.testing.scripted_user import Robot
from faceposer.solve.constraints.curve import CurveConstraint

WINDOW = (1360, 860)
IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"
LOWER_LIP = ("8.4", "8.8", "8.2", "8.7", "8.3")
Position = tuple[float, float]
Offset = tuple[float, float]


class Artist:
    """User of two programs at once."""

    def __init__(self, display: str, screen: Path) -> None:
        """Operate the program on ``display`` with the screen buffer in the file ``screen``."""
        self._screen = screen
        self._environment = os.environ | {"DISPLAY": display}
        self._app = App("man", hidden=True, threaded=False, settings=Settings(window_size=WINDOW, welcome_done=True))
        self._robot = Robot(self._app)

    def _do(self, *words: object) -> None:
        subprocess.run(["xdotool", *map(str, words)], env=self._environment, check=True, capture_output=True)

    # Positions

    def at(self, feature: str, offset: Offset = (0.0, 0.0)) -> Position:
        """Return the position of a feature point in the window plus ``offset`` pixels."""
        x, y = self._robot.at(feature)
        return (round(x + offset[0]), round(y + offset[1]))

    def control_point(self, number: int) -> Position:
        """Return the position of control point ``number`` of the only curve."""
        (curve,) = (c for c in self._app.session.document.constraints if isinstance(c, CurveConstraint))
        u, v = curve.target[number]
        left, top = self._app.viewport.origin
        return (round(u + left), round(v + top))

    def along(self, widget: str, share: float) -> Position:
        """Return the position on a slider at ``share`` of its width."""
        left, top, right, bottom = self._app.widget_rects[widget]
        return (round(left + share * (right - left)), round((top + bottom) / 2.0))

    # Actions

    def drag(self, *way: Position, steps: int = 10) -> None:
        """Press at the first position, move through all others, and release."""
        self._robot.move(way[0])
        self._robot.press()
        self._do("mousemove", *way[0], "sleep", 0.08, "mousedown", 1, "sleep", 0.05)
        for begin, end in itertools.pairwise(way):
            for share in np.linspace(0.0, 1.0, steps + 1)[1:]:
                place = tuple(round(begin[i] + share * (end[i] - begin[i])) for i in range(2))
                self._robot.move((place[0], place[1]))
                self._do("mousemove", *place, "sleep", 0.03)
        self._robot.release()
        self._do("mouseup", 1, "sleep", 0.25)

    def click(self, place: Position) -> None:
        """Click at ``place``."""
        self._robot.click(place)
        self._robot.frames(2)
        self._do("mousemove", *map(round, place), "sleep", 0.08, "mousedown", 1, "sleep", 0.06, "mouseup", 1)
        self._do("sleep", 0.3)

    def press(self, widget: str) -> None:
        """Click on ``widget``."""
        self.click(self._app.widget_rects.center(widget))

    def key(self, name: str) -> None:
        """Tap a key."""
        self._robot.key(name)
        names = {"Enter": "Return", "Esc": "Escape", "[": "bracketleft", "]": "bracketright"}
        words = [names.get(word, word.lower()) for word in name.split("+")]
        self._do("key", "+".join(words), "sleep", 0.25)

    def stroke(self, features: Sequence[str], offset: Offset = (0.0, 0.0), bow: float = 0.0) -> None:
        """Draw along feature points, moved by ``offset``; ``bow`` raises its middle."""
        last = len(features) - 1
        lifts = [bow * np.sin(np.pi * i / max(last, 1)) for i in range(len(features))]
        places = [self.at(name, (offset[0], offset[1] - lift)) for name, lift in zip(features, lifts, strict=True)]
        self.drag(*places, steps=8)

    def begin(self) -> None:
        """Return to the neutral face, the front view and the point tool."""
        for name in ("Esc", "Esc", "Q", "R", "1"):
            self.key(name)

    def report(self) -> str:
        """Return the residuals of the constraints and their conflicts."""
        session = self._app.session
        residuals = ", ".join(f"{residual:.1f}" for residual in session.residuals_px)
        return f"residuals {residuals} px; {self._app.drawn_constraints.conflicts or 'no conflicts'}"

    # Images

    def picture(self, constraints: bool = True) -> Image.Image:
        """Return the face as displayed by the real program, with or without overlays."""
        if not constraints:
            self.key("Esc")
            self.key("P")
        left, top, right, bottom = self._app.widget_rects["view"]
        # Move the pointer out of the way.
        self._do("mousemove", round(right - 8), round(bottom - 8), "sleep", 0.6)
        self._robot.move((right - 8, bottom - 8))
        image = read_window_dump(self._screen)
        if not constraints:
            self.key("P")
        middle, half = (left + right) / 2.0, 0.30 * (bottom - top)
        return image.crop((round(middle - half), round(top + 50), round(middle + half), round(bottom - 60)))

    def close(self) -> None:
        """Close the second program."""
        self._app.close()


def read_window_dump(path: Path) -> Image.Image:
    """Return the image in a file in X's window dump format with 32 bits per pixel, as written by Xvfb."""
    data = path.read_bytes()
    header = np.frombuffer(data, dtype=">u4", count=25)
    offset, width, height, line, colours = (int(header[i]) for i in (0, 4, 5, 12, 19))
    begin = offset + 12 * colours
    rows = np.frombuffer(data, dtype=np.uint8, count=line * height, offset=begin).reshape(height, line)
    return Image.fromarray(np.ascontiguousarray(rows[:, : 4 * width].reshape(height, width, 4)[:, :, 2::-1]))


def eyebrow(artist: Artist) -> list[Image.Image]:
    """Figure 1: an eyebrow drawn with one stroke."""
    artist.press("mode:1")
    artist.key("S")
    artist.stroke(("4.1", "4.3", "4.5"))
    artist.stroke(("4.1", "4.3", "4.5"), (0.0, -9.0), bow=7.0)
    shown = artist.picture()
    artist.key("Enter")
    print("  ", artist.report())
    return [shown, artist.picture(constraints=False)]


def smile(artist: Artist) -> list[Image.Image]:
    """Figure 11: strokes raise the cheeks, points fine-tune the corners of the mouth."""
    artist.press("mode:1")
    artist.key("S")
    for cheek, side in (("5.1", 1.0), ("5.2", -1.0)):
        x, y = artist.at(cheek)
        way = [(x - 20 * side, y + 12), (x, y + 5), (x + 20 * side, y - 6)]
        artist.drag(*[(round(a), round(b)) for a, b in way])
        artist.drag(*[(round(a + 9 * side), round(b - 12)) for a, b in way])
    artist.key("Q")
    for corner, side in (("8.3", 1.0), ("8.4", -1.0)):
        artist.drag(artist.at(corner), artist.at(corner, (18.0 * side, -22.0)))
    shown = artist.picture()
    artist.key("Enter")
    print("  ", artist.report())
    return [shown, artist.picture(constraints=False)]


def curve(artist: Artist) -> list[Image.Image]:
    """Figure 12: four shapes of the mouth by one curve along the lower lip."""
    artist.key("K")
    for feature in LOWER_LIP:
        artist.click(artist.at(feature, (0.0, 0.0)))
    artist.key("Enter")
    shapes: tuple[dict[int, Offset], ...] = (
        {0: (-14, -12), 4: (14, -12), 2: (0, 3)},
        {0: (2, 12), 4: (-2, 12)},
        {1: (0, 20), 2: (0, 30), 3: (0, 20)},
        {0: (15, 2), 4: (-15, 2), 1: (6, 2), 3: (-6, 2)},
    )
    pictures = []
    for shape in shapes:
        for number, (dx, dy) in shape.items():
            x, y = artist.control_point(number)
            artist.drag((x, y), (x + dx, y + dy))
        pictures.append(artist.picture())
        print("  ", artist.report())
        pictures.append(artist.picture(constraints=False))
        for _ in shape:
            artist.key("Ctrl+Z")
    return pictures[::2] + pictures[1::2]


def heights(artist: Artist) -> list[Image.Image]:
    """Figure 10: heights of the mouth by one slider."""
    artist.key("D")
    artist.press("measure:mouth height")
    pictures, share = [], None
    for target in (0.06, 0.22, 0.40, 0.60):
        place = artist.along("detail:target", target)
        artist.drag(artist.along("detail:target", share) if share is not None else place, place)
        share = target
        print("  ", artist.report())
        pictures.append(artist.picture())
    return pictures


def local(artist: Artist) -> list[Image.Image]:
    """Figure 13: eyes are closed by distances; fixed vertices keep the mouth open."""
    artist.key("D")
    artist.press("measure:mouth height")
    artist.drag(artist.along("detail:target", 0.02), artist.along("detail:target", 0.45))
    artist.key("Ctrl+Enter")
    artist.key("H")
    artist.press("hold:Mouth")
    artist.drag(artist.along("hold-weight", 0.5), artist.along("hold-weight", 0.8))
    artist.key("D")
    for side in ("left", "right"):
        artist.press(f"measure:{side} eye height")
        artist.drag(artist.along("detail:target", 0.5), artist.along("detail:target", 0.0))
    shown = artist.picture()
    print("  ", artist.report())
    return [shown, artist.picture(constraints=False)]


def sneer(artist: Artist) -> list[Image.Image]:
    """A one-sided sneer: the lip and the wing of the nose go up on one side, the other side is pinned."""
    artist.press("mode:1")
    artist.drag(artist.at("8.5"), artist.at("8.5", (4.0, -15.0)))
    artist.drag(artist.at("9.5"), artist.at("9.5", (2.0, -6.0)))
    for feature in ("8.4", "8.6", "9.4"):
        artist.click(artist.at(feature))
    shown = artist.picture()
    artist.key("Enter")
    print("  ", artist.report())
    return [shown, artist.picture(constraints=False)]


SCENES: dict[str, Callable[[Artist], list[Image.Image]]] = {
    scene.__name__: scene for scene in (eyebrow, smile, heights, curve, local, sneer)
}


def side_by_side(pictures: list[Image.Image]) -> Image.Image:
    """Return ``pictures`` in one image, in rows of at most four, each 340 pixels wide."""
    width = 340
    scaled = [picture.resize((width, round(picture.height * width / picture.width))) for picture in pictures]
    columns = min(len(scaled), 4)
    rows = -(-len(scaled) // columns)
    sheet = Image.new("RGB", (columns * (width + 6) - 6, rows * (scaled[0].height + 6) - 6), (24, 25, 27))
    for i, picture in enumerate(scaled):
        sheet.paste(picture, (i % columns * (width + 6), i // columns * (picture.height + 6)))
    return sheet


@contextlib.contextmanager
def virtual_display(folder: Path) -> Iterator[tuple[str, Path]]:
    """Run a virtual display; yield its name and the file with its screen buffer."""
    read, write = os.pipe()
    size = f"{WINDOW[0]}x{WINDOW[1]}x24"
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", size, "-fbdir", str(folder), "-nolisten", "tcp"]
    server = subprocess.Popen(command, pass_fds=[write], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os.close(write)
    with os.fdopen(read) as answer:
        display = f":{answer.readline().strip()}"
    try:
        yield display, folder / "Xvfb_screen0"
    finally:
        server.terminate()
        server.wait()


@contextlib.contextmanager
def real_program(display: str, folder: Path) -> Iterator[None]:
    """Run the program on ``display`` within the block."""
    (folder / "faceposer").mkdir()
    remembered = f'{{"window_size": [{WINDOW[0]}, {WINDOW[1]}], "welcome_done": true}}'
    (folder / "faceposer" / "window.json").write_text(remembered, encoding="utf-8")
    environment = os.environ | {"DISPLAY": display, "XDG_STATE_HOME": str(folder), "FACEPOSER_OWN_DIALOGS": "1"}
    environment.pop("WAYLAND_DISPLAY", None)
    program = subprocess.Popen([sys.executable, "-m", "faceposer"], env=environment, cwd=folder)
    try:
        found = subprocess.run(
            ["xdotool", "search", "--sync", "--onlyvisible", "--class", "faceposer"],
            env=environment,
            check=True,
            capture_output=True,
            text=True,
        ).stdout.split()[0]
        place = ["windowmove", "--sync", found, "0", "0", "windowsize", "--sync", found, *map(str, WINDOW)]
        subprocess.run(["xdotool", *place, "windowfocus", "--sync", found, "sleep", "1"], env=environment, check=True)
        yield
    finally:
        program.kill()
        program.wait()


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=SCENES, nargs="+", default=list(SCENES), help="scenes to make")
    parser.add_argument("-o", "--output", type=Path, default=IMAGES, help="folder (default: docs/images)")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    for name in options.only:
        began = time.perf_counter()
        with contextlib.ExitStack() as stack:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            display, screen = stack.enter_context(virtual_display(folder))
            stack.enter_context(real_program(display, folder))
            artist = Artist(display, screen)
            stack.callback(artist.close)
            side_by_side(SCENES[name](artist)).save(options.output / f"gallery-{name}.jpg", quality=90)
        print(f"gallery-{name}.jpg written, {time.perf_counter() - began:.0f} s")


if __name__ == "__main__":
    main()
