"""Pictures and films of faces: framed from every side, as long as they should be, and whole or not there."""

import os
import stat
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import binary_erosion

from faceposer.errors import FacePoserError
from faceposer.files import memory
from faceposer.interchange.formats import Output, check_writable, offered, write, write_sequence_steps, write_steps
from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.progress import Progress
from faceposer.render.ffmpeg import find_ffmpeg, missing_ffmpeg
from faceposer.render.offscreen import render_character
from faceposer.render.options import OutputOptions
from faceposer.render.turntable import orbit_framing, turned

pytestmark = pytest.mark.gl

SMALL = (96, 72)


@pytest.fixture(scope="module")
def yawn(low: FaceModel) -> Performance:
    opened = low.coefficients_of({"jawOpen": 1.0})
    return Performance(np.array([0.0, 0.5, 1.0, 1.0, 0.0, 0.0])[:, None] * opened, 10.0)


@pytest.mark.parametrize("size", [(400, 400), (800, 300), (300, 800)])
@pytest.mark.parametrize("name", ["low", "creature"])
def test_the_head_is_orbit_framing(name: str, size: tuple[int, int]) -> None:
    vertices = load_character(name).vertices
    view = orbit_framing([vertices], size)
    seen = np.array([turned(view, share, size).project(vertices) for share in np.linspace(0, 1, 48, endpoint=False)])
    lowest, highest = seen.min(axis=(0, 1)), seen.max(axis=(0, 1))
    assert (lowest > 0).all()
    assert (highest < size).all()
    filled = (highest - lowest) / size
    assert filled.max() > 0.85, "and not from too far away"


def test_a_turn_begins_in_front_and_passes_the_left_side(low: FaceModel) -> None:
    view = orbit_framing([low.character.vertices], SMALL)
    front, left, back = (turned(view, share, SMALL).center for share in (0.0, 0.25, 0.5))
    assert front[2] > 10
    assert left[0] > 10
    assert back[2] < -10


@pytest.mark.gl
def test_png_shows_the_pose(low: FaceModel, tmp_path: Path) -> None:
    look = OutputOptions(SMALL)
    write(tmp_path / "a.png", low, low.neutral(), look)
    write(tmp_path / "b.png", low, low.coefficients_of({"jawOpen": 1.0}), look)
    write(tmp_path / "c.png", low, low.neutral(), OutputOptions(SMALL, "left"))
    pictures = [np.asarray(Image.open(tmp_path / f"{name}.png"), dtype=float) for name in "abc"]
    assert pictures[0].shape == (72, 96, 3)
    assert np.abs(pictures[0] - pictures[1]).max() > 30
    assert np.abs(pictures[0] - pictures[2]).max() > 30


def frames_of(path: Path) -> tuple[list[np.ndarray], list[int]]:
    """Return the frames of a GIF, and how many milliseconds each lasts."""
    frames, lengths = [], []
    with Image.open(path) as film:
        for i in range(film.n_frames):
            film.seek(i)
            frames.append(np.asarray(film.convert("RGB"), dtype=float))
            lengths.append(film.info["duration"])
    return frames, lengths


@pytest.mark.gl
def test_gif_turns_the_pose_round_in_time(low: FaceModel, tmp_path: Path) -> None:
    shares: list[float] = []
    write(
        tmp_path / "a.gif",
        low,
        low.neutral(),
        OutputOptions(SMALL, turn=1.0, rate=12.0),
        Progress(lambda _, share: shares.append(share)),
    )
    frames, lengths = frames_of(tmp_path / "a.gif")
    assert len(frames) == 12
    assert frames[0].shape == (72, 96, 3)
    assert sum(lengths) == 1000
    assert set(lengths) == {80, 90}
    assert min(np.abs(a - b).mean() for a, b in zip(frames[1:], frames[:-1], strict=True)) > 1.0
    assert shares == sorted(shares)
    assert len(shares) == 12
    assert [*tmp_path.iterdir()] == [tmp_path / "a.gif"]


@pytest.mark.gl
def test_gif_plays_a_performance_from_one_place(low: FaceModel, yawn: Performance, tmp_path: Path) -> None:
    write(tmp_path / "a.gif", low, yawn, OutputOptions(SMALL))
    frames, lengths = frames_of(tmp_path / "a.gif")
    assert sum(lengths) == 600, "equal frames may have become one"
    assert np.abs(frames[0] - frames[2]).max() > 30
    assert np.abs(frames[0] - frames[2])[:8].max() < 12, "only the face moves"


def fake_ffmpeg(folder: Path, script: str) -> None:
    """Put a program called ffmpeg into ``folder`` that does what the Python ``script`` says."""
    program = folder / "ffmpeg"
    program.write_text(f"#!{sys.executable}\nimport sys\n{script}\n")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)


KEEPS = "open(sys.argv[-1], 'wb').write(' '.join(sys.argv[1:-1]).encode() + b'|' + sys.stdin.buffer.read())"


@pytest.mark.gl
@pytest.mark.skipif(os.name == "nt", reason="a script is no program there")
def test_mp4_hands_every_frame_to_ffmpeg(low: FaceModel, yawn: Performance, tmp_path: Path, no_ffmpeg: Path) -> None:
    fake_ffmpeg(no_ffmpeg, KEEPS)
    write(tmp_path / "a.mp4", low, yawn, OutputOptions((97, 73), rate=20.0))
    words, _, pixels = (tmp_path / "a.mp4").read_bytes().partition(b"|")
    assert b"-s 96x72 -r 20 " in words, "MP4 wants even sides"
    assert b"-pix_fmt yuv420p" in words
    # Six frames at 10 a second last six tenths of a second, the last one as long as the others.
    frames = np.frombuffer(pixels, np.uint8).reshape(-1, 72, 96, 3)
    assert len(frames) == 12
    write(tmp_path / "a.png", low, yawn.coefficients[2], OutputOptions((96, 72)))
    assert np.ptp(frames[0].astype(int) - frames[4].astype(int)) > 30
    assert {path.name for path in tmp_path.iterdir()} == {"a.mp4", "a.png"}


@pytest.mark.gl
@pytest.mark.skipif(os.name == "nt", reason="a script is no program there")
@pytest.mark.parametrize(
    ("script", "said"),
    [
        ("sys.stdin.buffer.read(); sys.exit('Unknown encoder')", r"ffmpeg cannot write .* \(Unknown encoder\)"),
        ("sys.stdin.close(); sys.exit('No room')", r"ffmpeg cannot write .* \(No room\)"),
        ("sys.stdin.buffer.read(); sys.exit(1)", "no reason given"),
    ],
)
def test_what_ffmpeg_says_is_told(script: str, said: str, low: FaceModel, tmp_path: Path, no_ffmpeg: Path) -> None:
    fake_ffmpeg(no_ffmpeg, script)
    with pytest.raises(FacePoserError, match=said):
        write(tmp_path / "a.mp4", low, low.neutral(), OutputOptions(SMALL, turn=0.5))
    assert not [*tmp_path.iterdir()]


@pytest.mark.usefixtures("no_ffmpeg")
def test_without_ffmpeg_a_sentence_says_so_and_mp4_is_not_offered(low: FaceModel, tmp_path: Path) -> None:
    with pytest.raises(FacePoserError, match=r"MP4 needs ffmpeg.*pip install 'faceposer\[film\]'.*\.gif"):
        write(tmp_path / "a.mp4", low, low.neutral())
    with pytest.raises(FacePoserError, match="MP4 needs ffmpeg"):
        check_writable(tmp_path / "a.mp4")
    assert not [*tmp_path.iterdir()]
    assert ".gif" in offered()
    assert ".mp4" not in offered()
    with pytest.raises(FacePoserError, match=r"must end in one of .*\.gif\.$"):
        check_writable(tmp_path / "a.bmp")


def test_the_systems_ffmpeg_comes_before_that_of_the_package(
    no_ffmpeg: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = ModuleType("imageio_ffmpeg")
    package.get_ffmpeg_exe = lambda: str(tmp_path / "bundled")  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", package)
    assert find_ffmpeg() == str(tmp_path / "bundled")
    assert ".mp4" in offered()
    fake_ffmpeg(no_ffmpeg, KEEPS)
    assert find_ffmpeg() == str(no_ffmpeg / "ffmpeg")


def test_a_package_without_its_program_is_none(no_ffmpeg: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> str:
        raise RuntimeError("No ffmpeg exe could be found.")

    package = ModuleType("imageio_ffmpeg")
    package.get_ffmpeg_exe = fail  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", package)
    assert missing_ffmpeg().startswith("MP4 needs ffmpeg")
    assert not [*no_ffmpeg.iterdir()]


@pytest.mark.gl
def test_the_package_writes_a_film(
    low: FaceModel, yawn: Performance, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("imageio_ffmpeg", reason="the extra 'film' is not installed")
    monkeypatch.setenv("PATH", str(tmp_path))
    write(tmp_path / "a.mp4", low, yawn, OutputOptions((64, 48)))
    reading = ["-i", str(tmp_path / "a.mp4"), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    read = subprocess.run([find_ffmpeg(), *reading], capture_output=True, check=True)
    frames = np.frombuffer(read.stdout, np.uint8).reshape(-1, 48, 64, 3).astype(float)
    assert len(frames) == 6
    assert np.abs(frames[0] - frames[2]).max() > 30
    assert b"10 fps" in read.stderr


def over(picture: np.ndarray, grey: float) -> np.ndarray:
    """Return what shows of ``picture``, (height, width, 4), over ``grey``."""
    alpha = picture[..., 3:] / 255.0
    shown: np.ndarray = picture[..., :3] * alpha + grey * (1.0 - alpha)
    return shown


@pytest.mark.gl
@pytest.mark.parametrize("name", ["man", "low"])
@pytest.mark.parametrize("view", ["front", "left"])
def test_without_background_no_edge_shows_one(name: str, view: str) -> None:
    character = load_character(name)
    camera = orbit_framing([character.vertices], (320, 320)).looking(view).camera((320, 320))
    clear = render_character(character, character.vertices, camera, transparent=True).astype(float)
    solid = render_character(character, character.vertices, camera).astype(float)
    alpha = clear[..., 3]
    assert clear.shape == (320, 320, 4)
    assert (alpha[:8] == 0).all()
    inside = alpha == 255
    assert 0.2 < inside.mean() < 0.9
    assert np.abs(clear[..., :3] - solid)[inside].max() < 12, "only noise and lashes may differ"
    # Each edge lies between its neighbours: over white none is darker than the skin beside it, over black none lighter
    # than what is there at all.
    edge = (alpha > 0) & (alpha < 255)
    assert edge.sum() > 100
    assert binary_erosion(edge, iterations=2).sum() > 100, "the neck fades into nothing"
    skin = clear[inside][:, :3]
    assert (clear[edge][:, :3].mean(axis=0) > 0.4 * skin.mean(axis=0)).all(), "no black has crept into the edges"
    background = solid[:8].mean()
    same = np.abs(over(clear, background) - solid).max(axis=-1)
    assert np.percentile(same[edge], 90) < 25
    assert (clear[alpha == 0] == 0).all()


@pytest.mark.gl
def test_png_without_background(low: FaceModel, yawn: Performance, tmp_path: Path) -> None:
    look = OutputOptions(SMALL, transparent=True)
    write(tmp_path / "a.png", low, low.neutral(), look)
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.mode == "RGBA"
        assert picture.getpixel((0, 0)) == (0, 0, 0, 0)
        assert picture.getpixel((48, 36))[3] == 255
    for _ in write_sequence_steps(Output(tmp_path / "v1.2 yawn", low, yawn, look), ".png"):
        pass
    names = sorted(path.name for path in (tmp_path / "v1.2 yawn").iterdir())
    assert names == [f"v1.2 yawn.000{i}.png" for i in range(1, 7)]
    with Image.open(tmp_path / "v1.2 yawn" / names[2]) as picture:
        assert picture.mode == "RGBA"
        assert picture.getextrema()[3] == (0, 255)
    for suffix in (".gif", ".obj", ".glb"):
        with pytest.raises(FacePoserError, match=r"cannot have a transparent background; write \.png"):
            write(tmp_path / f"b{suffix}", low, low.neutral(), look)
    with pytest.raises(FacePoserError, match="OBJ cannot have"):
        next(write_sequence_steps(Output(tmp_path / "b", low, yawn, look), ".obj"))


@pytest.mark.gl
@pytest.mark.skipif(os.name == "nt", reason="a script is no program there")
@pytest.mark.parametrize("suffix", [".gif", ".mp4"])
def test_a_film_that_is_stopped_leaves_nothing(suffix: str, low: FaceModel, tmp_path: Path, no_ffmpeg: Path) -> None:
    fake_ffmpeg(no_ffmpeg, KEEPS)
    steps = write_steps(Output(tmp_path / f"a{suffix}", low, low.neutral(), OutputOptions(SMALL, turn=1.0)))
    assert 0 < next(steps) < 0.1
    steps.close()  # type: ignore[attr-defined]
    assert not [*tmp_path.iterdir()]


@pytest.mark.gl
def test_what_cannot_be_written_gets_a_sentence(low: FaceModel, yawn: Performance, tmp_path: Path) -> None:
    with pytest.raises(FacePoserError, match="shows one pose, not 6"):
        write(tmp_path / "a.png", low, yawn, OutputOptions(SMALL))
    with pytest.raises(FacePoserError, match=r"must end in one of .*\.gif"):
        write(tmp_path / "a.bmp", low, low.neutral(), OutputOptions(SMALL))
    with pytest.raises(FacePoserError, match="cannot be written"):
        write(tmp_path / "none" / "a.gif", low, low.neutral(), OutputOptions(SMALL, turn=0.1))
    long = Performance(np.zeros((20_000, low.n_coefficients)), 1.0)
    with pytest.raises(FacePoserError, match="too long"):
        write(tmp_path / "a.gif", low, long, OutputOptions(SMALL, rate=25.0))
    with pytest.raises(FacePoserError, match="A GIF shows a frame for 655 seconds at most"):
        write(tmp_path / "a.gif", low, low.neutral(), OutputOptions(SMALL, turn=2000.0, rate=0.001))
    with pytest.raises(FacePoserError, match=r"A GIF of 1000 frames of 2000x2000 is too large"):
        write(tmp_path / "a.gif", low, low.neutral(), OutputOptions((2000, 2000), turn=40.0, rate=25.0))
    write(tmp_path / "a.ply", low, low.neutral())
    assert [path.name for path in tmp_path.iterdir()] == ["a.ply"]


def test_an_image_that_does_not_fit_into_memory_is_said(
    low: FaceModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(memory, "free_memory", lambda: 1 << 29)
    options = OutputOptions(size=(4096, 4096))
    with pytest.raises(FacePoserError, match=r"An image of 4096 x 4096 pixels takes about .* choose a smaller size"):
        write(tmp_path / "a.png", low, low.neutral(), options)
    assert not list(tmp_path.iterdir())
