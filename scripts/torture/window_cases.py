"""The window, used while the system refuses what it needs; each case runs in a child of its own."""

import json
import os
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from imgui_bundle import imgui
from PIL import Image

from faceposer.gui.app import App
from faceposer.gui.feature import Feature
from faceposer.gui.features.poses.feature import PosesFeature
from faceposer.gui.features.recovery.feature import RecoveryFeature
from faceposer.gui.settings import Settings, save_settings
from faceposer.gui.testing.scripted_user import Robot
from faceposer.gui.widgets.dialogs import Question
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.session.autosave import find_orphans
from faceposer.session.document import read_document, write_document
from scripts.torture.forked import Condition
from scripts.torture.inputs import CHARACTER, make_inputs, session_document

Work = Callable[[], None]
# Cases of the long form only: the tests try the same without a window, or with fewer names.
_LONG = (
    "names that are not UTF-8",
    "typed names",
    "many files and circles of links",
    "pins at one pixel",
    "home is a file",
    "home is a device",
    "no home",
    "the folder is removed",
)


class User:
    """A user of a hidden window, with what the window has told."""

    def __init__(self, folder: Path, what: str = CHARACTER, remembered: bool = False, **settings: object) -> None:
        chosen = Settings(window_size=(900, 680), folder=str(folder), welcome_done=True)
        for name, value in settings.items():
            setattr(chosen, name, value)
        if remembered:
            save_settings(chosen)
        self.app = App(what, hidden=True, threaded=False, settings=None if remembered else chosen, journal=True)
        draw = self.app.scene.draw
        view = self.app.viewport
        self.app.face_image = lambda _: draw(view.view.camera((64, 64)), "clay", False, 0)  # type: ignore[method-assign]
        self.robot = Robot(self.app)
        self.told: list[str] = []
        self.answer()

    def answer(self) -> None:
        """Close all dialogs, and keep what they say."""
        self.robot.frames(2)
        for dialog in self.app.dialogs.waiting:
            text = f"{dialog.title}: {dialog.text}"
            details = dialog.details if isinstance(dialog, Question) else ""
            if dialog.title == "Internal error" or details:
                raise AssertionError(f"{text}\n{details}")
            self.told.append(text)
        self.app.dialogs.waiting.clear()
        self.robot.frames(2)

    def heard(self, *parts: str) -> str:
        """Return what was told since the last call; it must hold all ``parts``."""
        self.answer()
        text, self.told = "\n".join(self.told), []
        for part in parts:
            assert part in text, f"{part!r} is not in {text!r}"
        return text

    def enter(self, key: str, name: str, accept: bool = True) -> str:
        """Open the file dialog of ``key`` and enter ``name``; return its message, or "" once it is closed."""
        self.robot.key(key)
        self.robot.frames(2)
        browser = self.app.file_dialogs._browser
        assert browser is not None, f"{key} opens no file dialog: {self.app.dialogs.waiting}"
        # Like a choice in the list: the field is not active.
        imgui.internal.clear_active_id()
        browser.name, browser._replacing, browser.message = name, None, ""
        self.robot.frames(2)
        if accept:
            self.robot.click_widget("files:accept")
            if self.app.file_dialogs._browser is browser and browser._replacing:
                self.robot.click_widget("files:accept")
        self.robot.frames(2)
        if self.app.file_dialogs._browser is None:
            return ""
        message, warns = browser.advice()
        self.robot.click_widget("files:cancel")
        self.robot.frames(2)
        return message if warns else ""

    def menu(self, *names: str) -> None:
        """Open a menu, and one within it, and close both."""
        self.answer()
        for name in names:
            self.robot.click_widget(f"menu:{name}")
            self.robot.frames(3)
        self.robot.key("Esc")
        self.robot.key("Esc")

    def drag(self) -> None:
        """Pull at the chin."""
        x, y = self.robot.at("2.1")
        self.robot.drag((x, y), (x + 12.0, y + 9.0))

    def end(self) -> None:
        """Check that the window is visible, and close it."""
        self.answer()
        assert imgui.get_style().alpha == 1.0, "the window is transparent"
        assert self.app.screenshot().mean() > 5.0, "the window is black"
        self.app.close()


def cases(root: Path, short: bool) -> list[tuple[str, Work, Condition]]:
    """Return name, work and condition of each case; ``short`` leaves some out."""
    root.mkdir()
    file = root / "home"
    file.touch()
    closed = root / "closed"
    closed.mkdir()
    closed.chmod(0o500)
    nothing = dict.fromkeys(("XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_STATE_HOME"))
    listed: list[tuple[str, Callable[[Path], None], Condition]] = [
        ("locked folders", _locked, Condition()),
        ("names that are not UTF-8", _odd_names, Condition()),
        ("two such names", lambda folder: _odd_names(folder, 2), Condition()),
        ("read-only state, full disk", _full, Condition(environment={"XDG_STATE_HOME": str(closed / "state")})),
        ("typed names", _typed, Condition()),
        ("many files and circles of links", _many, Condition()),
        ("files of others", _others, Condition()),
        ("an error while widgets are disabled", _disabled, Condition()),
        ("pins at one pixel", _pins, Condition()),
        ("home is a file", _plain, Condition(environment={**nothing, "HOME": str(file)})),
        ("no home", _plain, Condition(environment={**nothing, "HOME": None})),
        ("home is a device", _plain, Condition(environment={**nothing, "HOME": "/dev/null"})),
        ("the folder is removed", _removed, Condition()),
    ]
    chosen = [case for case in listed if not (short and case[0] in _LONG)]
    result: list[tuple[str, Work, Condition]] = []
    for i, (name, work, condition) in enumerate(chosen):
        # Settings and unsaved work of whoever runs this are left alone.
        own = {f"XDG_{kind}_HOME": str(root / f"user{i}") for kind in ("CONFIG", "DATA", "STATE")}
        environment = {**own, **condition.environment}
        result.append((name, _in_folder(work, root / f"w{i}"), replace(condition, environment=environment)))
    return result


def _in_folder(work: Callable[[Path], None], folder: Path) -> Work:
    def begin() -> None:
        folder.mkdir()
        work(folder)

    return begin


def _locked(folder: Path) -> None:
    """Every folder that the settings remember may not be entered any more."""
    inner = folder / "locked" / "in"
    inner.mkdir(parents=True)
    write_document(inner / "x.json", session_document(make_inputs(folder / "inputs")))
    (folder / "locked").chmod(0o000)
    inner_file = str(inner / "x.json")
    user = User(
        inner,
        recent=[inner_file],
        characters=[str(inner / "c.npz")],
        poses_folder=str(inner),
        autosave_folder=str(inner),
        export_path=str(inner / "x.obj"),
    )
    user.heard("autosave folder cannot be used")
    user.menu("File", "open-recent")
    user.app.files.recent.open(inner_file)
    user.heard("Permission denied")
    user.robot.click_widget("character")
    user.robot.frames(3)
    user.robot.key("Esc")
    user.menu("File", "new-with")
    user.robot.click_widget("tab:Poses")
    user.robot.frames(3)
    user.heard("pose library cannot be read")
    poses = user.app.features[PosesFeature]
    user.app.actions["pose-save"].run()
    user.robot.frames(3)
    user.robot.key("Enter")
    assert "cannot be written" in poses._name_dialog._problem, poses._name_dialog._problem
    user.robot.key("Esc")
    user.app.actions["pose-folder"].run()
    user.robot.frames(3)
    user.robot.click_widget("files:cancel")
    for key in ("Ctrl+O", "Ctrl+Shift+S", "Ctrl+E"):
        message = user.enter(key, inner_file)
        assert "Permission denied" in message, message
    for dropped in ("x.json", "c.glb", "p.png", "m.obj"):
        user.app.router._on_drop((str(inner / dropped),))
        user.answer()
        user.robot.key("Esc")
    user.drag()
    assert user.enter("Ctrl+S", str(folder / "saved.json")) == ""
    assert len(read_document(folder / "saved.json").constraints) == 1
    user.end()


def _odd_names(folder: Path, count: int = 8) -> None:
    """Names with bytes that are not UTF-8, control characters, "##" and percent signs, everywhere."""
    model = make_inputs(folder / "inputs")
    names = ["caf\udce9\t##\n", "%s%n%d", "tab\tline\nbreak", "a##b", "###x", "😀", "\u202ertl", "x" * 240][:count]
    for name in names:
        write_document(folder / f"{name}.json", session_document(model))
        (folder / f"d{name[:200]}").mkdir()
    character = folder / "ch\udce9##.npz"
    character.write_bytes(Path("assets/characters/low.npz").resolve().read_bytes())
    user = User(folder, recent=[str(folder / f"{name}.json") for name in names], characters=[str(character)])
    for name in names:
        path = folder / f"{name}.json"
        user.app.open_file(path)
        user.answer()
        assert user.app.session.path == path, f"{name!a} is not opened"
        user.drag()
        user.robot.key("Ctrl+S")
        user.answer()
        assert not user.app.session.dirty, f"{name!a} is not saved"
        user.menu("File", "open-recent")
        assert user.enter("Ctrl+Shift+S", f"{name}-2.json" if len(name) < 200 else name[:200]) == "", name
        user.app.file_dialogs.ask(_request(user, folder))
        user.robot.frames(3)
        user.robot.click_widget("files:cancel")
    user.app.open_file(character)
    user.answer()
    user.robot.click_widget("character")
    user.robot.frames(4)
    user.robot.key("Esc")
    for dropped in ("m\udce9.obj", "p\udce9.png", "c\udce9.glb", "t\udce9.csv", "s\udce9.json"):
        user.app.router._on_drop((str(folder / dropped),))
        user.robot.frames(4)
        user.robot.key("Esc")
        user.answer()
    user.end()


def _request(user: User, folder: Path) -> FileRequest:
    return FileRequest("open", "Open", "Sessions", (".json", ".npz"), folder, lambda _: None)


def _full(folder: Path) -> None:
    """Settings, journal and session cannot be written; the work stays in the window."""
    import resource
    import signal

    folder.mkdir(exist_ok=True)
    user = User(folder)
    user.app.remembers = True
    user.drag()
    user.robot.frames(30)
    user.heard("cannot be recovered after a crash")
    assert user.enter("Ctrl+S", "a.json") == ""
    user.heard("settings cannot be saved")
    before = (folder / "a.json").read_bytes()
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (64, limits[1]))
    user.drag()
    user.robot.key("Ctrl+S")
    user.heard("was not saved", "File too large")
    assert user.app.session.dirty
    assert (folder / "a.json").read_bytes() == before
    assert sorted(p.name for p in folder.iterdir()) == ["a.json"]
    resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    user.robot.key("Ctrl+S")
    assert user.heard() == "", "what cannot be written is told once"
    assert (folder / "a.json").read_bytes() != before
    user.end()


def _typed(folder: Path) -> None:
    """What a user may type into the file dialogs."""
    (folder / "dir.json").mkdir()
    (folder / "file").write_text("x")
    closed = folder / "closed"
    closed.mkdir()
    closed.chmod(0o500)
    user = User(folder)
    user.drag()
    for name, saving, opening in (
        ("n" * 300, "too long", "too long"),
        ("~nouser", "no user", "no user"),
        ("~nouser/x", "no user", "no user"),
        ("", "name", "name"),
        ("a/b", "does not exist", "does not exist"),
        ("file/b", "does not exist|Not a directory", "does not exist|Not a directory"),
        ("/proc/nothing/x", "does not exist", "does not exist"),
        (str(closed / "x.json"), "not writable", "does not exist"),
        ("x\0y", "no file name has", "no file name has"),
        ("/root-only/" + "d/" * 2500, "too long", "too long"),
    ):
        for key, expected in (("Ctrl+Shift+S", saving), ("Ctrl+O", opening)):
            message = user.enter(key, name)
            assert any(part in message for part in expected.split("|")), (key, name[:20], message)
            user.answer()
            assert user.told == [], user.told
    user.end()


def _many(folder: Path) -> None:
    """More files than are listed, links in circles and broken ones: folders are always there."""
    for i in range(6000):
        (folder / f"a{i}.txt").touch()
    for i in range(200):
        (folder / f"b{i}.json").touch()
    (folder / "zfolder").mkdir()
    (folder / "self").symlink_to("self")
    (folder / "self.json").symlink_to("self.json")
    (folder / "gone.json").symlink_to("nowhere.json")
    user = User(folder)
    for key in ("Ctrl+O", "Ctrl+Shift+S", "Ctrl+E"):
        user.robot.key(key)
        user.robot.frames(3)
        browser = user.app.file_dialogs._browser
        assert browser is not None
        assert (True, "zfolder") in browser._entries
        assert key == "Ctrl+E" or (False, "b199.json") in browser._entries
        assert "files:zfolder" in user.app.widget_rects
        user.robot.click_widget("files:cancel")
    assert "links" in user.enter("Ctrl+O", "self.json")
    user.answer()
    user.end()


def _others(folder: Path) -> None:
    """Another program or window changes the file of the session."""
    path = folder / "s.json"
    model = make_inputs(folder / "inputs")
    document = session_document(model).with_version_data(model)
    write_document(path, document)
    user = User(folder, str(path))
    user.drag()
    theirs = path.read_text().replace('"prior_weight": 1.0', '"prior_weight": 7.0')
    assert theirs != path.read_text()
    path.write_text(theirs)
    user.robot.key("Ctrl+S")
    user.heard("changed this file")
    assert path.read_text() == theirs
    assert user.app.session.dirty
    user.robot.key("Ctrl+S")
    user.robot.frames(3)
    user.robot.click_widget("choice:0")
    user.answer()
    assert json.loads(path.read_text())["prior_weight"] == 1.0
    user.drag()
    user.robot.key("Ctrl+S")
    assert user.heard() == "", "what was saved here is no change by others"
    child = os.fork()
    if not child:
        from faceposer.session.on_disk import OpenFile, open_files_folder

        other = OpenFile(open_files_folder())
        os._exit(0 if not other.hold(path) and other.hold(folder / "t.json") else 9)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0, "another window can hold the file, too"
    path.unlink()
    path.mkdir()
    user.drag()
    user.robot.key("Ctrl+S")
    user.heard("it is a folder")
    user.end()


def _disabled(folder: Path) -> None:
    """An error between the beginning and the end of disabled widgets leaves the window visible."""
    user = User(folder)
    feature = user.app.features[RecoveryFeature]

    def fail() -> None:
        imgui.begin("##broken")
        imgui.begin_disabled(True)
        imgui.begin_child("##inner")
        imgui.begin_disabled(True)
        raise ZeroDivisionError

    for _ in range(3):
        feature.draw_window = fail  # type: ignore[method-assign]
        user.robot.frames(1)
        feature.draw_window = lambda: Feature.draw_window(feature)  # type: ignore[method-assign]
        assert [dialog.title for dialog in user.app.dialogs.waiting] == ["Internal error"]
        user.app.dialogs.waiting.clear()
        user.robot.frames(3)
    sys.stderr.flush()
    user.end()


def _pins(folder: Path) -> None:
    """All pins of a photo at one pixel: what is saved can be opened again."""
    Image.new("RGB", (200, 200), "gray").save(folder / "p.png")
    user = User(folder)
    user.app.router._on_drop((str(folder / "p.png"),))
    user.robot.frames(4)
    left, top, right, bottom = user.app.widget_rects["view"]
    middle = ((left + right) / 2, (top + bottom) / 2)
    places = [(middle[0] + 14 * (i % 3), middle[1] + 14 * (i // 3)) for i in range(6)]
    for place in places:
        user.robot.click(place)
    for place in places:
        user.robot.drag(place, middle, steps=2)
    user.answer()
    assert user.app.session.document.photos[0].pins
    assert user.enter("Ctrl+S", "p.json") == ""
    user.heard()
    user.app.open_file(folder / "p.json")
    assert user.heard() == ""
    user.end()


def _plain(folder: Path) -> None:
    """Pose, save, export, open, the menus and the preferences, without a home folder."""
    user = User(folder, remembered=False)
    user.app.remembers = True
    user.drag()
    user.robot.frames(30)
    user.menu("File", "open-recent")
    user.robot.key("Ctrl+,")
    user.robot.frames(3)
    user.robot.key("Esc")
    user.app.actions["pose-save"].run()
    user.answer()
    user.robot.key("Enter")
    user.robot.key("Esc")
    user.answer()
    user.app.settings.folder = ""
    user.robot.key("Ctrl+O")
    user.robot.frames(2)
    user.robot.click_widget("files:home")
    user.robot.click_widget("files:cancel")
    user.app.settings.folder = str(folder)
    assert user.enter("Ctrl+S", str(folder / "a.json")) == ""
    assert user.enter("Ctrl+E", str(folder / "a.obj")) == ""
    user.answer()
    assert (folder / "a.json").is_file()
    assert (folder / "a.obj").is_file()
    assert len([line for line in user.told if "settings cannot be saved" in line]) <= 1, user.told
    user.end()


def _removed(folder: Path) -> None:
    """The folder of the session is removed: saving offers another one, and the journal is kept after a crash."""
    inner = folder / "inner"
    inner.mkdir()
    write_document(inner / "s.json", session_document(make_inputs(folder / "inputs")))
    user = User(inner, str(inner / "s.json"), autosave_folder=str(folder / "journal"))
    user.drag()
    user.robot.frames(30)
    (inner / "s.json").unlink()
    inner.rmdir()
    user.answer()
    user.robot.key("Ctrl+S")
    user.robot.frames(3)
    browser = user.app.file_dialogs._browser
    assert browser is not None
    assert browser.name == "s.json"
    user.robot.click_widget("files:cancel")
    assert user.app.session.dirty
    user.end()
    (orphan,) = find_orphans(folder / "journal").orphans
    assert len(orphan.document.constraints) == 2
