import io
import json
import re
import zipfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.model.character import Character, Part
from faceposer.model.character_file import available_characters, load_character, save_character
from faceposer.model.errors import InconsistentError
from faceposer.model.origin import Origin


def small_character() -> Character:
    """A square and, as another part, a triangle; two shapes."""
    shapes = np.zeros((2, 7, 3), dtype=np.float32)
    shapes[0, 2] = (0.5, -0.25, 3.0)
    shapes[1, 5] = (0.0, 1.0, 0.0)
    return Character(
        name="small",
        title="Small one",
        vertices=np.random.default_rng(3).normal(size=(7, 3)).astype(np.float32),
        polygons=np.array([[0, 1, 2, 3], [4, 5, 6, -1]], dtype=np.int32),
        uv=np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float32),
        polygon_uvs=np.array([[0, 1, 2, 3], [0, 1, 2, -1]], dtype=np.int32),
        parts=(Part("skin", "skin", (0, 1), (0, 4)), Part("eye_left", "eye", (1, 2), (4, 7))),
        shape_names=("jawOpen", "eyeLookUpLeft"),
        shapes=shapes,
        regions={"mouth": np.array([1, 2], dtype=np.int32)},
        feature_points={"2.1": 0, "11.4": 3},
        feature_titles={"2.1": "bottom of the chin"},
        textures={"skin": b"\x89PNG and so on"},
        credits="Nobody, CC0, ñ",
    )


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    path = tmp_path / "small.npz"
    save_character(path, small_character())
    return path


def test_what_is_saved_is_loaded(saved: Path) -> None:
    character, loaded = small_character(), load_character(saved)
    for name in ("name", "title", "parts", "shape_names", "feature_points", "feature_titles", "textures", "credits"):
        assert getattr(loaded, name) == getattr(character, name)
    for name in ("vertices", "polygons", "uv", "polygon_uvs"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(character, name))
        assert getattr(loaded, name).dtype == getattr(character, name).dtype
    np.testing.assert_allclose(loaded.shapes, character.shapes, atol=1.01e-4)
    assert loaded.shapes.dtype == np.float32
    np.testing.assert_array_equal(loaded.regions["mouth"], [1, 2])
    assert [path.name for path in saved.parent.iterdir()] == ["small.npz"], "no temporary file is left"


def test_quads_are_split_and_triangles_kept() -> None:
    character = small_character()
    np.testing.assert_array_equal(character.triangles, [[0, 1, 2], [0, 2, 3], [4, 5, 6]])
    np.testing.assert_array_equal(character.triangle_uvs, [[0, 1, 2], [0, 2, 3], [0, 1, 2]])
    np.testing.assert_array_equal(character.triangle_polygons, [0, 0, 1])
    assert [character.part_triangles(part) for part in character.parts] == [(0, 2), (2, 3)]
    assert character.part("eye_left").material == "eye"
    with pytest.raises(KeyError):
        character.part("horn")


def test_height_is_measured_from_chin_to_crown() -> None:
    character = small_character()
    assert character.height == pytest.approx(character.vertices[3, 1] - character.vertices[0, 1])


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"vertices": np.full((7, 3), np.nan, np.float32)}, "not finite"),
        ({"vertices": np.zeros((7, 2), np.float32)}, "shape"),
        ({"shapes": np.zeros((2, 6, 3), np.float32)}, "shapes"),
        ({"polygons": np.array([[0, 1, 2, 9], [4, 5, 6, -1]], np.int32)}, "out of range"),
        ({"polygons": np.array([[0, 1, -2, 3], [4, 5, 6, -1]], np.int32)}, "out of range"),
        ({"polygon_uvs": np.array([[0, 1, 2, 3], [0, 1, 2, 3]], np.int32)}, "disagree"),
        ({"parts": (Part("skin", "skin", (0, 1), (0, 4)),)}, "do not cover"),
        ({"parts": (Part("skin", "wool", (0, 2), (0, 7)),)}, "unknown material"),
        ({"parts": (Part("a", "skin", (0, 1), (0, 3)), Part("b", "eye", (1, 2), (3, 7)))}, "another part"),
        ({"shape_names": ("jawOpen", "jawOpen")}, "same name"),
        ({"regions": {"mouth": np.array([7], np.int32)}}, "do not exist"),
        ({"feature_points": {"2.1": 7, "11.4": 3}}, "does not exist"),
        ({"textures": {"hair": b""}}, "no material"),
    ],
)
def test_parts_that_do_not_fit_are_refused(change: dict[str, object], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        replace(small_character(), **change)


def assert_refused(path: Path, complaint: str) -> None:
    with pytest.raises(FacePoserError, match=re.escape(str(path))) as caught:
        load_character(path)
    text = str(caught.value)
    assert re.search(complaint, text), text
    assert text.endswith(".")
    assert "\n" not in text


def rewritten(path: Path, **members: bytes | None) -> Path:
    """Replace or drop members of the archive ``path``."""
    with zipfile.ZipFile(path) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    for name, data in members.items():
        content.pop(f"{name}.npy", None)
        if data is not None:
            content[f"{name}.npy"] = data
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in content.items():
            archive.writestr(name, data)
    return path


def packed(array: object) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, np.asarray(array), allow_pickle=True)
    return buffer.getvalue()


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 0.999])
def test_truncated_files_are_refused(saved: Path, share: float) -> None:
    data = saved.read_bytes()
    saved.write_bytes(data[: int(share * len(data))])
    assert_refused(saved, "damaged")


def test_flipped_bytes_never_end_in_a_traceback(saved: Path) -> None:
    data = saved.read_bytes()
    rng = np.random.default_rng(1)
    for _ in range(60):
        broken = bytearray(data)
        for position in rng.integers(0, len(data), 3):
            broken[position] ^= int(rng.integers(1, 256))
        saved.write_bytes(broken)
        with suppress(FacePoserError):
            load_character(saved)


def test_what_is_no_character_is_refused(tmp_path: Path) -> None:
    text = tmp_path / "notes.npz"
    text.write_text("these are my notes")
    assert_refused(text, "not a character")
    other = tmp_path / "other.npz"
    np.savez(other, weights=np.zeros(3))
    assert_refused(other, "not a Face Poser character")
    assert_refused(tmp_path / "missing.npz", "no character file")
    folder = tmp_path / "folder.npz"
    folder.mkdir()
    assert_refused(folder, "cannot be read")


def test_members_that_lie_are_refused(saved: Path) -> None:
    assert_refused(rewritten(saved, vertices=None), "'vertices' is missing")
    assert_refused(rewritten(saved, vertices=packed(np.full((7, 3), np.inf, np.float32))), "not finite")
    assert_refused(rewritten(saved, vertices=packed(["seven"])), "not real numbers")
    assert_refused(rewritten(saved, vertices=packed(np.array([{"a": 1}]))), "never loaded")
    huge = packed(np.zeros((7, 3), np.float32)).replace(b"(7, 3)", b"(7000000000, 3)".ljust(6))
    assert_refused(rewritten(saved, vertices=huge), "exceeds its data|damaged|cannot be used")


def test_the_description_is_checked(saved: Path) -> None:
    with zipfile.ZipFile(saved) as archive:
        meta = json.loads(np.load(io.BytesIO(archive.read("meta.npy"))).tobytes())

    def with_meta(**change: object) -> Path:
        return rewritten(saved, meta=packed(np.frombuffer(json.dumps(meta | change).encode(), np.uint8)))

    assert_refused(with_meta(version=3), "version 3")
    assert_refused(with_meta(format="other"), "not a Face Poser character")
    assert_refused(with_meta(title=5), "not text")
    assert_refused(with_meta(shape_step=float("nan")), "step")
    assert_refused(with_meta(shape_step="a"), "cannot be used")
    assert_refused(with_meta(parts=[{"name": "skin"}]), "missing")
    assert_refused(with_meta(parts=7), "cannot be used")
    assert_refused(rewritten(saved, meta=packed(np.frombuffer(b"[" * 100_000, np.uint8))), "not a Face Poser character")
    load_character(with_meta())


def test_names_are_found_and_others_refused_with_a_choice() -> None:
    assert ("man", "Man") in available_characters()
    assert ("woman", "Woman") in available_characters()
    with pytest.raises(FacePoserError, match=r"'horse'.*'man'"):
        load_character("horse")
    with pytest.raises(FacePoserError, match="no character"):
        load_character("../characters/man")
    with pytest.raises(FacePoserError, match="no character"):
        load_character("")


def test_an_unwritable_place_is_named(tmp_path: Path) -> None:
    with pytest.raises(FacePoserError, match="nowhere"):
        save_character(tmp_path / "nowhere" / "small.npz", small_character())


def with_member(path: Path, name: str, values: np.ndarray) -> Path:
    """Replace an array of the character file ``path``."""
    with np.load(path) as archive:
        arrays = dict(archive)
    np.savez(path, **{**arrays, name: values})
    return path


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("vertices", np.zeros_like, "all its vertices lie at one place"),
        ("vertices", lambda v: np.full_like(v, 2.0**31), "all its vertices lie at one place"),
        ("vertices", lambda v: v * np.float32(1e-9), "all its vertices lie at one place"),
        ("vertices", lambda v: v * np.array([1, 0, 0], np.float32), "all its vertices lie on a line"),
        ("vertices", lambda v: np.full_like(v, 1e30), r"vertices contains numbers beyond 1e\+12"),
        ("vertices", lambda v: np.full_like(v, np.nan), "vertices contains numbers that are not finite"),
        ("uv", lambda v: np.full_like(v, 1e30), r"uv contains numbers beyond 1e\+12"),
        ("shape_limits", lambda v: np.full_like(v, 1e30), r"shape_limits contains numbers beyond 1e\+12"),
        ("shape_limits", lambda v: np.full_like(v, -np.inf), "shape_limits contains numbers that are not finite"),
    ],
)
def test_degenerate_and_far_numbers_are_said(
    name: str, change: Callable[[np.ndarray], np.ndarray], said: str, saved: Path
) -> None:
    with np.load(saved) as archive:
        values = archive[name]
    with pytest.raises(FacePoserError, match=said):
        load_character(with_member(saved, name, change(values)))


@pytest.mark.parametrize(
    ("linear", "said"),
    [
        (np.zeros((3, 3)), "origin.linear cannot be inverted"),
        (np.diag([1.0, 1.0, 0.0]), "origin.linear cannot be inverted"),
        (np.full((3, 3), 7.0), "origin.linear cannot be inverted"),
        (np.full((3, 3), 1e30), r"origin.linear contains numbers that are not finite or beyond 1e\+12"),
        (np.full((3, 3), np.nan), "origin.linear contains numbers that are not finite"),
        (np.eye(3) * 1e-30, "origin.linear cannot be inverted"),
    ],
)
def test_an_origin_that_cannot_be_inverted_is_said(linear: np.ndarray, said: str) -> None:
    none = np.zeros((0, 3), np.int32)
    quad = np.array([[0, 1, 2, 3]], np.int32)
    with pytest.raises(InconsistentError, match=said):
        Origin(linear, np.zeros((4, 3)), np.arange(4, dtype=np.int32), quad, np.zeros((0, 2)), none, ())
    mirrored = np.diag([-0.01, 0.01, 0.01])
    Origin(mirrored, np.zeros((4, 3)), np.arange(4, dtype=np.int32), quad, np.zeros((0, 2)), none, ())
