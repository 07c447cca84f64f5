"""Things done in the window over and over: the memory, the objects and the buffers of the GPU stay as many."""

import gc
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from PIL import Image

from faceposer.geometry.camera import Camera
from faceposer.gui.app import App
from faceposer.gui.features.import_character.feature import ImportCharacterFeature
from faceposer.gui.settings import Settings
from faceposer.gui.testing.scripted_user import Robot
from faceposer.interchange.formats import FORMATS, Output, write_sequence_steps, write_steps
from faceposer.model.character_file import load_character, save_character
from faceposer.model.performance import Performance
from faceposer.photo.photo import Photo, Pin
from faceposer.render.options import OutputOptions
from faceposer.session.document import Document, write_document
from scripts.torture.inputs import make_inputs, session_document

#: Cycles that are not measured, since caches and the heap fill; share of the measured ones that begins and ends.
WARM_UP, _ENDS = 0.3, 0.2
_GPU = (moderngl.Buffer, moderngl.Texture, moderngl.Framebuffer, moderngl.Renderbuffer, moderngl.VertexArray)
Step = Callable[[int], None]


class Window:
    """A hidden window of a character, with a folder of inputs."""

    def __init__(self, folder: Path, character: str) -> None:
        self.folder = folder
        self.model = make_inputs(folder / "inputs")
        settings = Settings(
            window_size=(700, 520), welcome_done=True, folder=str(folder), poses_folder=str(folder / "poses")
        )
        self.app = App(character, hidden=True, threaded=False, settings=settings)
        draw, view = self.app.scene.draw, self.app.viewport
        self.app.face_image = lambda _: draw(view.view.camera((64, 64)), "clay", False, 0)  # type: ignore[method-assign]
        self.robot = Robot(self.app)
        self.robot.frames(3)

    def open(self, what: str | Path) -> None:
        """Open a character or a session; nothing may be asked."""
        self.app.files.open(str(what))
        self.robot.frames(3)
        self.app.scene.draw(self.app.viewport.view.camera((64, 64)), "full", False, 0)
        self.check()

    def check(self) -> None:
        """Raise an AssertionError if a dialog has come up."""
        texts = [dialog.text for dialog in self.app.dialogs.waiting]
        assert not texts, texts


def _characters(window: Window) -> Step:
    """Switch among shipped characters and character files that are new each time."""
    low = load_character("low")

    def step(i: int) -> None:
        path = window.folder / f"own{i % 3}.npz"
        save_character(path, replace(low, title=f"Own {i}"))
        for what in ("creature", str(path), "man", "low"):
            window.open(what)

    return step


def _photos(window: Window) -> Step:
    """Open sessions with photos, look through them, and move pins."""
    size = (400, 300)
    character = window.model.character
    camera = Camera(np.diag([1.0, -1.0, -1.0]), np.array([3.0, -2.0, 120.0]), 900.0, size)
    names = list(character.feature_points)[:8]
    seen = camera.project(character.vertices[[character.feature_points[name] for name in names]])
    pins = tuple(Pin(name, (float(u), float(v))) for name, (u, v) in zip(names, seen, strict=True))
    for k in range(3):
        picture = window.folder / f"photo{k}.png"
        Image.new("RGB", size, (80 + 20 * k, 90, 90)).save(picture)
        photo = Photo(str(picture), size, pins, camera)
        write_document(
            window.folder / f"photo{k}.json", Document("low", photos=(photo,)).with_version_data(window.model)
        )

    def step(i: int) -> None:
        window.open(window.folder / f"photo{i % 3}.json")
        window.app.actions["photo-look"].run()
        window.robot.frames(3)
        window.app.actions["photo-pose"].run()
        window.app.session.wait()
        window.robot.frames(3)
        window.app.session.undo()
        window.robot.frames(2)
        window.check()
        window.app.session.save(window.folder / "saved.json", window.app.viewport.camera)
        window.open("low")

    return step


def _solves(window: Window) -> Step:
    """Open a session, drag at the face, undo, and open it again."""
    path = window.folder / "session.json"
    write_document(path, session_document(window.model).with_version_data(window.model))

    def step(i: int) -> None:
        window.open(path)
        for k in range(4):
            x, y = window.robot.at("2.1")
            window.robot.drag((x, y), (x + 10.0 - 5 * k, y + 8.0 + i % 3), steps=4)
        for _ in range(window.app.session.depth):
            window.app.session.undo()
        window.app.session.save(path, window.app.viewport.camera)

    return step


def _thumbnails(window: Window) -> Step:
    """Draw the thumbnails of all poses again."""
    window.robot.click_widget("tab:Poses")

    def step(i: int) -> None:
        # Thumbnails belong to a session and to a setting of the expression lines.
        window.app.actions["expression-lines"].run()
        window.open("low")
        window.robot.frames(30)
        window.check()

    return step


def _exports(window: Window) -> Step:
    """Write all formats, with the window's OpenGL."""
    app = window.app

    def step(i: int) -> None:
        model = app.session.model
        pose = model.coefficients_of({"jawOpen": 0.1 * (i % 10)})
        performance = Performance(np.stack([pose, 0.5 * pose]), 30.0)
        options = OutputOptions(size=(64, 64))
        for suffix, form in FORMATS.items():
            motion = performance if form.animated else pose
            if form.missing():
                continue
            path = window.folder / f"face{suffix}"
            for _ in write_steps(Output(path, model, motion, options, app.gl)):
                pass
            if form.sequence is not None:
                path = window.folder / f"take{suffix[1:]}{i}"
                for _ in write_sequence_steps(Output(path, model, performance, options, app.gl), suffix):
                    pass
                for file in path.iterdir():
                    file.unlink()
                path.rmdir()
        window.robot.frames(2)

    return step


def _imports(window: Window) -> Step:
    """Import a rig by the dialog, open the character, and go back."""
    feature = window.app.features[ImportCharacterFeature]

    def step(i: int) -> None:
        feature.show(str(window.folder / "inputs" / "rig"))
        window.robot.frames(3)
        (window.folder / "rig.npz").unlink(missing_ok=True)
        feature._train(window.folder / "rig.npz")
        end = time.monotonic() + 60.0
        while feature.running and time.monotonic() < end:
            window.robot.frames(1)
            time.sleep(0.01)
        window.robot.frames(3)
        window.check()
        feature.open_learned()
        window.robot.frames(3)
        assert window.app.session.model.character.name == "rig", window.app.session.model.character.name
        window.open("low")

    return step


#: What can be done over and over, by name.
CYCLES: dict[str, Callable[[Window], Step]] = {
    "characters": _characters,
    "photos": _photos,
    "solves": _solves,
    "thumbnails": _thumbnails,
    "exports": _exports,
    "imports": _imports,
}


def counts() -> dict[str, float]:
    """Return the number of Python's memory blocks and of live buffers, textures and the like."""
    gc.collect()
    live = sum(
        isinstance(found, _GPU) and not isinstance(found.mglo, moderngl.InvalidObject) for found in gc.get_objects()
    )
    return {"blocks": float(sys.getallocatedblocks()), "gpu_objects": float(live)}


def play(
    name: str, cycles: int, memory: Callable[[], dict[str, float]], tell: Callable[[dict[str, Any]], None]
) -> dict[str, Any]:
    """Play the cycle ``name`` so many times in a new window; return the growth of each figure per cycle."""
    rows: list[dict[str, float]] = []
    with tempfile.TemporaryDirectory() as folder:
        window = Window(Path(folder), "low")
        try:
            step = CYCLES[name](window)
            for i in range(cycles):
                step(i)
                rows.append({**memory(), **counts()})
                if (i + 1) % max(cycles // 10, 1) == 0:
                    tell({"cycle": name, "number": i + 1, **rows[-1]})
        finally:
            window.app.close()
    return growth(name, rows)


def growth(name: str, rows: list[dict[str, float]]) -> dict[str, Any]:
    """Return the growth of each figure per cycle after the first ones: of the medians of the begin and the end."""
    measured = rows[int(WARM_UP * len(rows)) :]
    few = max(int(_ENDS * len(measured)), 1)
    result: dict[str, Any] = {"cycle": name, "cycles": len(rows)}
    for key in sorted(set(rows[0]) - {"peak_mb", "free_mb"}):
        begin, end = (float(np.median([row[key] for row in part])) for part in (measured[:few], measured[-few:]))
        result[key] = end
        result[f"{key}_per_cycle"] = round((end - begin) / max(len(measured) - few, 1), 4)
    return result
