"""Fixtures that all tests share, and the check that tests which draw with OpenGL are marked."""

import io
import sys
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import moderngl
import pytest

from faceposer.files.images import open_image
from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.render import mesh_buffers
from faceposer.render.ffmpeg import bundled_ffmpeg

if TYPE_CHECKING:
    from tests.windows import OpenWindow


@pytest.fixture(scope="session")
def man() -> FaceModel:
    """The shipped man with the shipped prior."""
    return build_face_model(load_character("man"))


@pytest.fixture
def no_ffmpeg(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Neither the system nor a package has ffmpeg; gives the only folder in which programs are looked for."""
    folder = tmp_path_factory.mktemp("bin")
    monkeypatch.setenv("PATH", str(folder))
    # None makes the import fail.
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    bundled_ffmpeg.cache_clear()
    yield folder
    bundled_ffmpeg.cache_clear()


@pytest.fixture(scope="session")
def model(man: FaceModel) -> FaceModel:
    """The face of tests that need one, whichever it is: the man."""
    return man


@pytest.fixture(scope="session")
def woman() -> FaceModel:
    """The shipped woman."""
    return build_face_model(load_character("woman"))


@pytest.fixture(scope="session")
def low() -> FaceModel:
    """The head of few triangles, which is quick to draw and to write."""
    return build_face_model(load_character("low"))


@pytest.fixture(scope="session")
def creature() -> FaceModel:
    """The goblin, learned from examples alone."""
    return build_face_model(load_character("creature"))


@lru_cache(maxsize=64)
def _small_texture(data: bytes) -> bytes:
    small = io.BytesIO()
    try:
        with open_image(io.BytesIO(data)) as image:
            image.resize((32, 32)).save(small, "PNG")
    except Exception:  # what is damaged is for the program to find
        return data
    return small.getvalue()


@pytest.fixture
def small_textures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Windows load the textures of characters in 32 x 32 pixels, which is most of the time that they take to open."""
    load = mesh_buffers._texture
    monkeypatch.setattr(mesh_buffers, "_texture", lambda ctx, data: load(ctx, _small_texture(data)))


@pytest.fixture
def open_window(tmp_path: Path, request: pytest.FixtureRequest) -> "Iterator[OpenWindow]":
    """Opens hidden windows, see ``tests.windows.OpenWindow``."""
    from faceposer.gui.app import App
    from faceposer.gui.settings import Settings
    from faceposer.gui.testing.few_pixels import draw_few_pixels
    from faceposer.gui.testing.scripted_user import Robot

    running: list[App] = []

    def call(
        what: str = "low",
        size: tuple[int, int] = (900, 680),
        pictures: bool = False,
        journal: bool = False,
        **settings: Any,
    ) -> Robot:
        if not pictures:
            request.getfixturevalue("small_textures")
        chosen = Settings(window_size=size, folder=str(tmp_path), **settings)
        app = App(what, hidden=True, threaded=False, settings=chosen, journal=journal)
        running.append(app)
        if not pictures:
            draw_few_pixels(app)
        return Robot(app)

    yield call
    for app in running:
        if app._window is not None:
            app.close()


#: Modules that begin the run: one of them at the end would keep one of two cores busy alone.
LONGEST = frozenset({"test_on_display.py", "test_train_prior.py", "test_random_events.py", "test_widget_ids.py"})

#: Fixtures that open a window or make a context of OpenGL: tests with one of them are marked ``gl`` by themselves.
DRAWING = frozenset({"open_window", "robot", "renderer", "ctx"})


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests that draw by their fixtures, and let the longest begin."""
    items.sort(key=lambda item: item.path.name not in LONGEST)
    for item in items:
        if DRAWING & set(getattr(item, "fixturenames", ())):
            item.add_marker(pytest.mark.gl)


class _MarkGuard:
    """Fails tests that draw and are not marked ``gl``, so that ``scripts/test --fast`` needs no OpenGL."""

    def __init__(self) -> None:
        self._create = moderngl.create_context
        self._test = ""
        moderngl.create_context = self._guarded

    def _guarded(self, *arguments: Any, **options: Any) -> moderngl.Context:
        if self._test:
            pytest.fail(f"{self._test} draws with OpenGL: mark it with pytest.mark.gl")
        return self._create(*arguments, **options)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self._test = "" if item.get_closest_marker("gl") else item.nodeid
        return (yield)


def pytest_configure(config: pytest.Config) -> None:
    """Watch all tests."""
    config.pluginmanager.register(_MarkGuard())
