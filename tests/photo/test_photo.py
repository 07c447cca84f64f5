"""Photos as data and as files: they come back as written, and wrong ones get one sentence."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from faceposer.errors import FacePoserError
from faceposer.files.json_documents import convert
from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoint
from faceposer.photo import reading
from faceposer.photo.photo import Photo, PhotoJson, PhotosJson, Pin
from faceposer.photo.pins_file import read_pins
from faceposer.photo.reading import focal_in_mm, focal_in_pixels, inspect_photo, read_photo

CAMERA = Camera(np.diag([1.0, -1.0, -1.0]), np.array([1.0, 2.0, 90.0]), 700.0, (640, 480), (12.5, -3.0))


def photo() -> Photo:
    pins = (Pin("8.3", (10.5, 20.0)), Pin(77, (30.0, 40.0)), Pin(SurfacePoint(5, (0.2, 0.3, 0.5)), (1.0, 2.0)))
    return Photo("faces/a.jpg", (640, 480), pins, CAMERA, 700.0, 0.4, True, False)


def test_photos_come_back_as_they_were_written() -> None:
    data = json.loads(json.dumps([photo().to_json(), Photo("b.png", (10, 20)).to_json()]))
    assert [form.photo() for form in convert(data, PhotosJson)] == [photo(), Photo("b.png", (10, 20))]
    assert convert({"path": "b.png", "size": [10, 20]}, PhotoJson).photo() == Photo("b.png", (10, 20))


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"colour": 1}, "'colour'"),
        ({"path": ""}, "photos[0].path"),
        ({"size": [640]}, "photos[0].size"),
        ({"size": [0, 480]}, "photos[0].size"),
        ({"size": [320, 240]}, "photos[0].camera"),
        ({"opacity": 1.5}, "photos[0].opacity"),
        ({"focal": -1}, "photos[0].focal"),
        ({"front": 1}, "photos[0].front"),
        ({"pins": [{"point": 8, "pixel": [1, 2]}]}, "photos[0].pins[0].point"),
        ({"pins": [{"point": "8.3", "pixel": [1]}]}, "photos[0].pins[0].pixel"),
        ({"pins": [{"anchor": {"vertex": -1}, "pixel": [1, 2]}]}, "photos[0].pins[0].anchor"),
        ({"pins": [{"point": "8.3", "pixel": [1, 2]}] * 2}, "photos[0].pins[1]"),
    ],
)
def test_what_is_wrong_is_refused_with_its_place(change: dict[str, Any], place: str) -> None:
    with pytest.raises(FacePoserError) as raised:
        convert([photo().to_json() | change], PhotosJson, "photos")
    assert place in str(raised.value)


def test_a_place_has_one_pin() -> None:
    moved = photo().with_pin(Pin("8.3", (50.0, 60.0)))
    assert [pin.pixel for pin in moved.pins] == [(50.0, 60.0), (30.0, 40.0), (1.0, 2.0)]
    assert photo().with_pin(Pin("8.4", (5.0, 6.0))).pins[3] == Pin("8.4", (5.0, 6.0))
    assert [pin.place for pin in photo().without_pin(1).pins] == ["8.3", SurfacePoint(5, (0.2, 0.3, 0.5))]


def write_jpeg(path: Path, orientation: int | None = None, focal: int | None = None) -> None:
    pixels = np.zeros((40, 60, 3), dtype=np.uint8)
    pixels[:, :30] = (250, 10, 10)
    exif = Image.Exif()
    if orientation is not None:
        exif[0x0112] = orientation
    if focal is not None:
        exif.get_ifd(0x8769)[0xA405] = focal
    Image.fromarray(pixels).save(path, quality=95, exif=exif)


def test_pictures_stand_upright_and_tell_their_focal_length(tmp_path: Path) -> None:
    write_jpeg(tmp_path / "plain.jpg")
    assert inspect_photo(tmp_path / "plain.jpg") == reading.PhotoFile((60, 40), None)
    write_jpeg(tmp_path / "turned.jpg", orientation=6, focal=50)
    file = inspect_photo(tmp_path / "turned.jpg")
    assert file.size == (40, 60)
    assert file.focal == pytest.approx(50.0 / 43.267 * np.hypot(40, 60), rel=1e-4)
    assert focal_in_mm(focal_in_pixels(85.0, (40, 60)), (40, 60)) == pytest.approx(85.0)
    pixels = read_photo(tmp_path / "turned.jpg")
    assert pixels.shape == (60, 40, 3)
    assert pixels[10, 20, 0] > 200, "the left half is on top"
    assert pixels[50, 20, 0] < 60
    write_jpeg(tmp_path / "unknown.jpg", focal=0)
    assert inspect_photo(tmp_path / "unknown.jpg").focal is None


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif", ".webp", ".avif"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_size_and_pixels_agree_in_every_format(suffix: str, orientation: int, tmp_path: Path) -> None:
    pixels = np.zeros((40, 60, 3), dtype=np.uint8)
    for channel, quarter in enumerate((np.s_[:20, :30], np.s_[:20, 30:], np.s_[20:, :30])):
        pixels[(*quarter, channel)] = 255
    path = tmp_path / f"a{suffix}"
    if suffix == ".tif":
        Image.fromarray(pixels).save(path, tiffinfo={0x0112: orientation})
    else:
        exif = Image.Exif()
        exif[0x0112] = orientation
        Image.fromarray(pixels).save(path, quality=95, exif=exif)
    expected = np.array([pixels, pixels[:, ::-1], pixels[::-1, ::-1], pixels[::-1]][(orientation - 1) % 4])
    if orientation > 4:
        turned = pixels.swapaxes(0, 1)
        expected = [turned, turned[:, ::-1], turned[::-1, ::-1], turned[::-1]][orientation - 5]
    upright = read_photo(path)
    height, width = upright.shape[:2]
    assert inspect_photo(path).size == (width, height)
    assert upright.shape == expected.shape
    for y, x in ((5, 5), (5, -5), (-5, 5), (-5, -5)):
        assert np.abs(upright[y, x].astype(int) - expected[y, x]).max() < 60
    assert read_photo(path, 30).shape[0] * width == pytest.approx(read_photo(path, 30).shape[1] * height, rel=0.05)


def test_heic_is_told_by_its_content_and_jpeg_by_its_own(tmp_path: Path) -> None:
    heic = b"\x00\x00\x00\x18ftypheic\x00\x00\x00\x00mif1heic" + bytes(100)
    for name in ("a.heic", "a.jpg", "a.heif"):
        (tmp_path / name).write_bytes(heic)
        with pytest.raises(FacePoserError, match=rf"{name}' is a HEIC image, .* save it as JPEG"):
            inspect_photo(tmp_path / name)
    write_jpeg(tmp_path / "b.jpg")
    (tmp_path / "b.jpg").rename(tmp_path / "b.heic")
    assert inspect_photo(tmp_path / "b.heic").size == (60, 40)
    (tmp_path / "c.nef").write_bytes(b"II*\x00" + bytes(60))
    with pytest.raises(FacePoserError, match="is a raw image of a camera"):
        read_photo(tmp_path / "c.nef")


def test_pictures_are_brought_down_and_lose_their_transparency(tmp_path: Path) -> None:
    layer = np.zeros((50, 100, 4), dtype=np.uint8)
    layer[..., 3] = 255
    layer[:, 50:, 3] = 0
    Image.fromarray(layer).save(tmp_path / "layer.png")
    pixels = read_photo(tmp_path / "layer.png", largest=50)
    assert pixels.shape == (25, 50, 3)
    assert pixels[12, 10].max() < 5
    assert pixels[12, 40].min() > 30


@pytest.mark.parametrize(("kind", "white"), [(np.uint16, 65535.0), (np.float32, 1.0), (np.float32, 200.0)])
def test_pictures_of_more_than_8_bits_keep_their_tones(kind: type, white: float, tmp_path: Path) -> None:
    ramp = np.tile(np.linspace(0.0, white, 64), (8, 1)).astype(kind)
    path = tmp_path / ("a.png" if kind is np.uint16 else "a.tif")
    Image.fromarray(ramp).save(path)
    top = 200.0 if white == 200.0 else 255.0
    np.testing.assert_allclose(read_photo(path)[3, :, 1], np.linspace(0.0, top, 64), atol=1.0)


def test_what_cannot_be_read_is_said_in_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(name: str) -> str:
        with pytest.raises(FacePoserError) as raised:
            read_photo(tmp_path / name)
        assert name in str(raised.value)
        assert "\n" not in str(raised.value)
        return str(raised.value)

    assert "There is no photo" in refused("none.jpg")
    (tmp_path / "text.jpg").write_text("no picture")
    assert "not an image" in refused("text.jpg")
    (tmp_path / "a.heic").write_bytes(b"ftypheic")
    assert "save it as JPEG" in refused("a.heic")
    write_jpeg(tmp_path / "cut.jpg")
    (tmp_path / "cut.jpg").write_bytes((tmp_path / "cut.jpg").read_bytes()[:700])
    refused("cut.jpg")
    write_jpeg(tmp_path / "large.jpg")
    monkeypatch.setattr(reading, "MAX_PIXELS", 1000)
    assert "60 x 40" in refused("large.jpg")


def test_pins_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "pins.json"
    data = {"format": "faceposer.pins", "version": 1, "pins": [pin.to_json() for pin in photo().pins]}
    path.write_text(json.dumps(data))
    assert read_pins(path) == photo().pins
    for change, words in (
        ({"version": 2}, "version"),
        ({"pins": 3}, "pins must be a list"),
        ({"photo": "a.jpg"}, "'photo'"),
    ):
        path.write_text(json.dumps(data | change))
        with pytest.raises(FacePoserError, match=words):
            read_pins(path)
    path.write_text("{")
    with pytest.raises(FacePoserError, match="not valid JSON"):
        read_pins(path)
    with pytest.raises(FacePoserError, match="There is no file of pins"):
        read_pins(tmp_path / "none.json")
    assert replace(photo(), path="/x/y.jpg").name == "y.jpg"
