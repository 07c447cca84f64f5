"""The demo: a scripted user of the real program, without a display, recorded as images."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from faceposer.errors import FacePoserError
from faceposer.gui.app import App
from faceposer.gui.settings import Settings
from faceposer.gui.testing.recorder import Recorder
from faceposer.gui.testing.scripted_user import Robot
from faceposer.model.feature_curves import feature_curves
from faceposer.render.images import write_png

_WINDOW = (1200, 780)
# MPEG-4 feature points.
LEFT_CORNER, RIGHT_CORNER, LOWER_LIP, LEFT_BROW = "8.3", "8.4", "8.2", "4.1"


@dataclass(frozen=True)
class DemoFiles:
    """Files written by the demo."""

    frames: tuple[Path, ...]
    animation: Path
    image: Path
    mesh: Path
    session: Path


class _Script:
    """The steps of the user, with captions."""

    def __init__(self, app: App, recorder: Recorder, folder: Path) -> None:
        self.app = app
        self.robot = Robot(app, lambda robot: recorder.take(robot.position, robot.pressed is not None))
        self._recorder = recorder
        self._folder = folder

    def play(self) -> None:
        """Play all steps."""
        self._say("A neutral face")
        self._rest(4)
        self._say("Drag the left corner of the mouth: the whole face follows")
        self._pull(LEFT_CORNER, 13.0, -16.0)
        self._say("... then the right one, a little")
        self._pull(RIGHT_CORNER, -1.5, -2.0)
        self._say("Raise the inner end of a brow")
        self._pull(LEFT_BROW, 1.0, -9.0)
        self._say("Sketch the other brow as it should look: it is recognised", "E")
        self.robot.key("E")
        self._sketch("right brow", -7.0)
        self.robot.key("Q")
        self._say("Orbit by dragging beside the face")
        self._orbit(130.0, 10.0)
        self._say("Drag from any side")
        self._pull(LOWER_LIP, 0.0, 3.5)
        self._say("Undo", "Ctrl+Z")
        self.robot.key("Ctrl+Z")
        self._rest(4)
        self._say("Redo", "Ctrl+Shift+Z")
        self.robot.key("Ctrl+Shift+Z")
        self._rest(4)
        self._say("Front view", "1")
        self.robot.key("1")
        self._rest(2)
        write_png(self._folder / "pose.png", self.app.screenshot())
        self._say("Compare with the neutral face", "C")
        self.robot.key("C")
        self._rest(4)
        self.robot.key("C")
        self._rest(2)
        self._say("Save the posed mesh", "Ctrl+E")
        self._save("Ctrl+E", "pose.obj")
        self._say("Save the session", "Ctrl+S")
        self._save("Ctrl+S", "session.json")
        self._say("")
        self._rest(4)

    def _say(self, text: str, key: str = "") -> None:
        self._recorder.caption = f"{text}   {key}".rstrip()

    def _rest(self, frames: int) -> None:
        self._recorder.hold(frames)

    def _pull(self, feature: str, across: float, down: float) -> None:
        """Drag a feature point by 1/450 of the head's height in the view per unit."""
        x, y = self.robot.at(feature)
        unit = self._head_height() / 450.0
        self.robot.move((x, y), 5, ease=True)
        self.robot.press()
        self.robot.move((x + across * unit, y + down * unit), 9, ease=True)
        self.robot.release()
        self._rest(3)

    def _sketch(self, feature: str, down: float) -> None:
        """Draw ``feature`` of the present face, moved by 1/450 of the head's height in the view per unit."""
        app = self.app
        points = feature_curves(app.session.model.character)[feature][0].points
        pixels = app.viewport.camera.project(app.session.model.positions_at(points, app.session.coefficients))
        way = pixels + app.viewport.origin + (0.0, down * self._head_height() / 450.0)
        self.robot.draw([(x, y) for x, y in way[:: max(len(way) // 12, 1)].tolist()], ease=5)
        self._rest(4)

    def _orbit(self, across: float, down: float) -> None:
        left, top, right, bottom = self.app.widget_rects["view"]
        begin = (left + 0.12 * (right - left), top + 0.75 * (bottom - top))
        self.robot.move(begin, 4, ease=True)
        self.robot.press()
        self.robot.move((begin[0] + across, begin[1] + down), 9, ease=True)
        self.robot.release()
        self._rest(2)

    def _head_height(self) -> float:
        camera, vertices = self.app.viewport.camera, self.app.session.model.character.vertices
        rows = camera.project(vertices)[:, 1]
        return float(rows.max() - rows.min())

    def _save(self, key: str, name: str) -> None:
        """Save to ``name`` in the folder of the demo, with the file dialog."""
        self.robot.key(key)
        self._rest(2)
        self.robot.key("Ctrl+A")
        self.robot.type(name)
        self._rest(3)
        self.robot.click_widget("files:accept")
        if self.app.dialogs.open or not (self._folder / name).is_file():
            raise FacePoserError(f"The demo could not save '{self._folder / name}'.")
        self._rest(3)


def run(folder: Path, progress: Callable[[str], None] = print) -> DemoFiles:
    """Play the demo, write its frames, an animation, the mesh and the session into ``folder``, and return their paths.

    Args:
        folder: Created if it does not exist; files of an earlier demo are replaced.
        progress: Called with a message about the written files.

    Raises:
        FacePoserError: If no hidden window can be opened, or the folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        frames_folder = folder / "frames"
        frames_folder.mkdir(exist_ok=True)
        for old in [*frames_folder.glob("frame-*.png"), folder / "pose.obj", folder / "session.json"]:
            old.unlink(missing_ok=True)
    except OSError as error:
        raise FacePoserError(f"The folder '{folder}' cannot be written: {error.strerror}.") from error
    settings = Settings(window_size=_WINDOW, folder=str(folder.resolve()), welcome_done=True)
    app = App("man", hidden=True, threaded=False, settings=settings)
    try:
        recorder = Recorder(app.screenshot, frames_folder)
        _Script(app, recorder, folder).play()
        files = DemoFiles(
            tuple(recorder.frames),
            recorder.write_animation(folder / "demo.gif"),
            folder / "pose.png",
            folder / "pose.obj",
            folder / "session.json",
        )
    finally:
        app.close()
    names = ", ".join(path.name for path in (files.animation, files.image, files.mesh, files.session))
    progress(f"{len(files.frames)} frames, {names} written to {folder}")
    return files
