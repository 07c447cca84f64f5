"""Films are read in any form, or refused in one sentence."""

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from faceposer.errors import FacePoserError
from faceposer.film import film as films
from faceposer.film import pictures
from faceposer.film.film import Span, check_span, seconds_of
from faceposer.film.opening import is_film, open_film
from faceposer.film.video import Video
from tests.film.films import Pixels, encode, only_sound, turned_clockwise

_GREY = (40, 80, 120, 160, 200, 240)


def steps(width: int = 64, height: int = 48) -> list[Pixels]:
    """Return frames that are brighter from one to the next, with a dark left half."""
    frames = [np.full((height, width, 3), grey, dtype=np.uint8) for grey in _GREY]
    for frame in frames:
        frame[:, : width // 2] = 10
    return frames


def brightness(path: Path, span: Span | None = None, largest: int = 64) -> dict[int, int]:
    """Return the brightness of the right edge of each frame."""
    return {frame.number: int(frame.pixels[:, -8:].mean()) for frame in open_film(path).frames(span or Span(), largest)}


@pytest.mark.parametrize(
    ("name", "codec", "pixel_format", "size"),
    [
        ("plain.mp4", "mpeg4", "yuv420p", (64, 48)),
        ("odd.mkv", "ffv1", "yuv444p", (61, 47)),
        ("ten.mkv", "ffv1", "yuv420p10le", (64, 48)),
        ("grey.mkv", "ffv1", "gray", (64, 48)),
        ("h264.mov", "libx264", "yuv420p", (64, 48)),
        ("web.webm", "libvpx-vp9", "yuv420p", (64, 48)),
    ],
)
def test_films_in_many_forms(name: str, codec: str, pixel_format: str, size: tuple[int, int], tmp_path: Path) -> None:
    path = encode(tmp_path / name, steps(*size), 25, codec, pixel_format)
    film = open_film(path)
    assert (film.size, film.rate) == (size, 25.0)
    found = brightness(path)
    assert list(found) == [0, 1, 2, 3, 4, 5]
    np.testing.assert_allclose(list(found.values()), _GREY, atol=6)


def test_a_part_begins_and_ends_where_it_should(tmp_path: Path) -> None:
    path = encode(tmp_path / "a.mp4", steps(), 10)
    assert list(brightness(path, Span(0.2, 0.4))) == [2, 3]
    film = open_film(path)
    with pytest.raises(FacePoserError, match=r"'.*a\.mp4' has 0\.60 seconds; choose a part that begins before"):
        check_span(film, Span(0.7))


def test_large_frames_are_reduced(tmp_path: Path) -> None:
    path = encode(tmp_path / "a.mp4", steps(320, 160), 10)
    frame = next(iter(open_film(path).frames(Span(), 80)))
    assert frame.pixels.shape == (40, 80, 3)


def test_films_of_phones_are_turned_upright(tmp_path: Path) -> None:
    path = turned_clockwise(encode(tmp_path / "phone.mp4", steps(), 10))
    film = open_film(path)
    assert film.size == (48, 64)
    frame = next(iter(film.frames(Span(), 64)))
    # The left half, turned clockwise, is the upper one.
    assert frame.pixels.shape == (64, 48, 3)
    assert frame.pixels[:28].mean() < 20
    assert frame.pixels[36:].mean() > 30


def test_frames_at_uneven_times_are_put_on_frames_of_the_film(tmp_path: Path) -> None:
    path = encode(tmp_path / "uneven.mkv", steps(), 10, "ffv1", "yuv420p", times=[0.0, 0.1, 0.2, 0.52, 0.6, 0.7])
    film = open_film(path, rate=10.0)
    numbers = [frame.number for frame in film.frames(Span(), 64)]
    assert numbers == [0, 1, 2, 5, 6, 7]
    half = [frame.number for frame in open_film(path, rate=5.0).frames(Span(), 64)]
    assert half == sorted(set(half))
    assert half[-1] <= 4


def test_a_folder_and_a_gif_are_films_without_pyav(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    folder = tmp_path / "frames"
    folder.mkdir()
    for k, pixels in enumerate(steps()):
        Image.fromarray(pixels).save(folder / f"f{k + 6}.png")
    film = open_film(folder)
    assert "30 frames per second were assumed" in film.notes[0]
    assert [int(f.pixels[0, -1, 0]) for f in film.frames(Span(), 64)] == list(_GREY)
    images = [Image.fromarray(pixels) for pixels in steps()]
    images[0].save(tmp_path / "a.gif", save_all=True, append_images=images[1:], duration=[100, 100, 200, 100, 100, 100])
    film = open_film(tmp_path / "a.gif")
    assert (film.rate, film.size) == (10.0, (64, 48))
    frames = list(film.frames(Span(), 64))
    # The third picture is held for two frames.
    assert [f.number for f in frames] == list(range(7))
    assert np.array_equal(frames[3].pixels, frames[2].pixels)
    assert not np.array_equal(frames[4].pixels, frames[3].pixels)
    assert [f.number for f in film.frames(Span(0.3, 0.5), 64)] == [3, 4]


def test_pyav_is_asked_for_in_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.mp4").write_bytes(b"\0\0\0\x18ftypmp42" + bytes(100))
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(FacePoserError, match=r"^The film '.*a\.mp4' needs PyAV, .* 'faceposer\[film\]'\.$"):
        open_film(tmp_path / "a.mp4")
    with pytest.raises(FacePoserError, match=r"^There is no film '.*none\.mp4'; check the path"):
        open_film(tmp_path / "none.mp4")


def test_what_is_no_film_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("av", reason="the extra 'film' is not installed")
    (tmp_path / "text.mp4").write_text("no film at all\n" * 100)
    (tmp_path / "empty.mp4").write_bytes(b"")
    (tmp_path / "list.mp4").write_text("#EXTM3U\n#EXTINF:1,\nother.ts\n#EXT-X-ENDLIST\n")
    for name in ("text.mp4", "empty.mp4", "list.mp4"):
        with pytest.raises(FacePoserError, match=rf"'.*{name}' is not a film that can be read, or is damaged; save"):
            open_film(tmp_path / name)
    with pytest.raises(FacePoserError, match=r"There is no film '.*none\.mp4'; check the path"):
        open_film(tmp_path / "none.mp4")
    with pytest.raises(FacePoserError, match=r"'.*sound\.wav' has only sound; choose"):
        open_film(only_sound(tmp_path / "sound.wav"))
    (tmp_path / "a.gif").write_bytes(b"GIF89a" + bytes(30))
    with pytest.raises(FacePoserError, match=r"'.*a\.gif' is damaged or no GIF"):
        open_film(tmp_path / "a.gif")
    (tmp_path / "folder").mkdir()
    with pytest.raises(FacePoserError, match=r"'.*folder' has no pictures"):
        open_film(tmp_path / "folder")


def test_damage_in_the_middle_is_named(tmp_path: Path) -> None:
    path = encode(tmp_path / "a.mkv", [*steps(160, 120)] * 4, 10, "ffv1")
    data = bytearray(path.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 4000] = b"\xff" * 4000
    path.write_bytes(data)
    with pytest.raises(
        FacePoserError, match=r"'.*a\.mkv' is damaged at frame \d+ \(\d\.\d\d s\); choose a part that ends before"
    ):
        list(open_film(path).frames(Span(), 160))


def test_a_film_that_ends_before_its_stated_time_is_noted(tmp_path: Path) -> None:
    path = encode(tmp_path / "a.mkv", steps(160, 120) * 5, 10)
    film = open_film(path)
    assert len(list(film.frames(Span(), 160))) == 30
    assert film.notes == ()
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    film = open_film(path)
    n_read = len(list(film.frames(Span(), 160)))
    assert 0 < n_read < 25
    assert len(film.notes) == 1
    assert re.match(rf"The film states 3\.00 s, but its pictures end at {n_read / 10:.2f} s; ", film.notes[0])
    part = open_film(path)
    list(part.frames(Span(0.0, 0.2), 160))
    assert part.notes == ()


def test_frames_marked_as_corrupt_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    film = Video(encode(tmp_path / "a.mp4", steps(), 10))
    decoded = film._decoded

    def damaged(container: Any, stream: Any) -> Iterator[tuple[Any, float]]:
        for frame, time in decoded(container, stream):
            array = frame.to_ndarray(format="rgb24")
            corrupt = SimpleNamespace(is_corrupt=time > 0.25, to_ndarray=lambda array=array, **_: array)
            yield corrupt, time

    monkeypatch.setattr(film, "_decoded", damaged)
    assert len(list(film.frames(Span(0.0, 0.3), 64))) == 3
    with pytest.raises(FacePoserError, match=r"damaged at frame 3 \(0\.30 s\); choose a part that ends before 0\.30 s"):
        list(film.frames(Span(), 64))


def test_a_folder_that_cannot_be_entered_is_said_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Administrators may enter all folders.
    monkeypatch.setattr(pictures, "can_enter", lambda _path: False)
    with pytest.raises(FacePoserError, match=r"'.*' cannot be read; change its permissions"):
        open_film(tmp_path)


def test_sizes_are_checked_before_memory_is_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = encode(tmp_path / "a.mp4", steps(), 10)
    monkeypatch.setattr(films, "MOST_FRAMES", 4)
    with pytest.raises(FacePoserError, match=r"has 6 frames, and at most 4 are used, 0 seconds; choose a shorter"):
        check_span(open_film(path), Span())
    with pytest.raises(FacePoserError, match=r"choose a shorter part\.$"):
        check_span(open_film(path), Span())
    check_span(open_film(path), Span(0.2))
    monkeypatch.setattr(films, "MOST_PIXELS", 1000)
    with pytest.raises(FacePoserError, match=r"frames of 64 x 48 pixels, more than 0 million; reduce"):
        open_film(path)


def test_films_are_known_by_their_ending_or_their_first_bytes(tmp_path: Path) -> None:
    (tmp_path / "a.bin").write_bytes(b"\x1aE\xdf\xa3" + bytes(20))
    (tmp_path / "b.bin").write_bytes(b"time,8.3.x\n")
    assert is_film(tmp_path / "a.bin")
    assert not is_film(tmp_path / "b.bin")
    assert is_film(Path("nothing.MOV"))
    assert is_film(tmp_path)
    assert not is_film(Path("nothing.csv"))


def test_times() -> None:
    assert [seconds_of(text) for text in ("2.5", "1:02.5", "1:00:00")] == [2.5, 62.5, 3600.0]
    for text in ("", "a", "-1", "1:2:3:4", "1e9", "nan"):
        with pytest.raises(ValueError, match="^" + text):
            seconds_of(text)
