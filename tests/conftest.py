"""Fixtures that all tests share."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.subject_file import load_subject
from faceposer.render.ffmpeg import bundled_ffmpeg


@pytest.fixture(scope="session")
def model() -> FaceModel:
    """The shipped man with the shipped prior."""
    return build_face_model(load_subject("man"))


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
