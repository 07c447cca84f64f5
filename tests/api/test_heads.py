"""Heads through the Python interface."""

import gc
import re
import weakref
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import faceposer
from faceposer import Face, FacePoserError
from faceposer.geometry.mesh_io import read_mesh
from faceposer.geometry.obj_io import write_obj
from faceposer.identity.editing import head_editor
from faceposer.photo.photo import Photo
from faceposer.session.key_folder import KeyFolder
from faceposer.session.opening import open_session
from tests.command_line import run_captured


@pytest.fixture
def face() -> Face:
    return faceposer.load("man")


def test_a_new_head_has_its_attributes_and_is_reproducible() -> None:
    face = faceposer.new_head(seed=3, attributes={"age": 0.5, "nose_length": -0.3})
    assert face.attributes["age"] == pytest.approx(0.5, abs=0.01)
    assert face.attributes["nose-length"] == pytest.approx(-0.3, abs=0.01)
    again = faceposer.new_head(3, {"age": 0.5, "nose-length": -0.3})
    np.testing.assert_array_equal(face.vertices, again.vertices)
    assert face.head.texture is not None
    assert face.head.texture == again.head.texture
    assert not face.head.same(faceposer.new_head(4, {"age": 0.5, "nose-length": -0.3}).head)


def test_variety_and_caricature_scale_the_distance_from_the_average() -> None:
    half, twice = (faceposer.new_head(1, variety=0.5, caricature=c, texture=None) for c in (1.0, 2.0))
    assert half.distance_from_average == pytest.approx(0.5, abs=0.15)
    assert twice.distance_from_average == pytest.approx(2.0 * half.distance_from_average)
    assert faceposer.new_head(1, variety=0.0).distance_from_average == 0.0


def test_the_pose_stays_while_the_head_changes(face: Face) -> None:
    face.set_weights({"mouthSmileLeft": 0.8, "jawOpen": 0.3})
    pose, before = face.coefficients, face.vertices
    face.set_attributes(age=0.8, mouth_width=0.5)
    np.testing.assert_array_equal(face.coefficients, pose)
    assert np.abs(face.vertices - before).max() > 0.1
    assert face.attributes["mouth-width"] == pytest.approx(0.5, abs=0.01)
    face.restore_head()
    np.testing.assert_array_equal(face.vertices, before)


def test_heads_are_mixed_with_their_skins(face: Face, tmp_path: Path) -> None:
    woman = faceposer.load("woman")
    own = face.attributes["gender"]
    face.mix("woman", 0.4)
    assert face.attributes["gender"] == pytest.approx(own + 0.4 * (woman.attributes["gender"] - own), abs=0.05)
    assert face.head.texture is not None
    tone = face.head.texture.coefficients[0]
    model = [head_editor(each.session.base_model.character).own_texture() for each in (face, woman)]
    assert tone == pytest.approx(0.6 * model[0].coefficients[0] + 0.4 * model[1].coefficients[0])
    face.mix(woman, 1.0)
    assert face.distance_from_average == pytest.approx(woman.distance_from_average)
    face.save(tmp_path / "mixed.json")
    assert open_session(str(tmp_path / "mixed.json")).document.identity.same(face.head)  # type: ignore[union-attr]


def test_parts_of_the_head_are_random(face: Face) -> None:
    own, image = face.head, face.character.textures["skin"]
    face.randomise(5, segments="nose", texture=None)
    changed = [not np.array_equal(a, b) for a, b in zip(own.shape, face.head.shape, strict=True)]
    assert changed == [name == "nose" for name in face._head_editor.segment_names]
    assert face.character.textures["skin"] == image
    face.set_skin(tone=2.0)
    assert face.character.textures["skin"] != image
    assert face.head.texture is not None
    assert face.head.texture.coefficients[0] == 2.0
    face.set_skin("own")
    assert face.character.textures["skin"] == image


def test_a_head_becomes_a_character(face: Face, tmp_path: Path) -> None:
    face.set_weights({"jawOpen": 0.5})
    face.caricature(1.5)
    face.save_character(tmp_path / "me.npz", title="Me")
    again = faceposer.load(tmp_path / "me.npz")
    assert (again.character.name, again.character.title) == ("me", "Me")
    np.testing.assert_array_equal(again.vertices, face.model.character.vertices)
    assert "ICT-FaceKit" in again.character.credits
    again.set_weights({"jawOpen": 0.5})
    np.testing.assert_allclose(again.vertices, face.vertices, atol=1e-2)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda face: face.set_attributes(nose=1.0), "no attribute 'nose'"),
        (lambda face: face.set_attributes(age=9.0), "from -0.8 to 1.4, not 9"),
        (lambda face: face.set_attributes(age=float("nan")), "from -0.8 to 1.4, not nan"),
        (lambda face: face.set_attributes(age="old"), "'age' must be a number"),
        (lambda face: face.set_attributes([("age", 1.0)]), "given by name"),
        (lambda face: face.set_attributes({1: 0.5}), "must be a text, not 1"),
        (lambda face: face.mix(None), "other head must be"),
        (lambda face: face.caricature(-1.0), "factor of a caricature"),
        (lambda face: face.mix("woman", 1.5), "share"),
        (lambda face: face.mix("creature"), "Goblin"),
        (lambda face: face.randomise(-1), "seed"),
        (lambda face: face.randomise(variety=float("inf")), "variety"),
        (lambda face: face.randomise(segments="chin"), "segment"),
        (lambda face: face.set_skin("green"), "no skin 'green'"),
        (lambda face: face.set_skin(tone=3.0), "tone"),
        (lambda face: face.save_character("me.obj"), "npz"),
        (lambda face: face.save_character("me.npz", title=" "), "title"),
        (lambda face: face.save_character("me.npz", title="x" * 5000), "title"),
        (lambda face: face.save_character("me.npz", title="a\0b"), "title"),
        (lambda _: faceposer.load("low").set_attributes(age=0.5), "cannot be edited"),
        (lambda _: faceposer.new_head(1, base="creature"), "cannot be edited"),
    ],
)
def test_other_arguments_get_one_sentence(
    face: Face, call: object, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FacePoserError, match=message):
        call(face)  # type: ignore[operator]
    assert face.session.document.identity is None
    assert not list(tmp_path.iterdir())


def test_heads_that_were_changed_again_are_released(face: Face) -> None:
    models = []
    gc.disable()
    try:
        for seed in range(5):
            face.randomise(seed, texture=None)
            x, y = face.pixel("8.3")
            face.drag("8.3", (x + 20.0, y - 10.0))
            models.append(weakref.ref(face.model))
        # The last three are cached for undo.
        assert [model() is None for model in models] == [True, True, False, False, False]
    finally:
        gc.enable()


def test_the_example_of_the_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    page = (Path(__file__).resolve().parents[2] / "docs" / "identity.md").read_text(encoding="utf-8")
    (example,) = [code for code in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "new_head" in code]
    names: dict[str, Face] = {}
    exec(compile(example, "docs/identity.md", "exec"), names)
    face = names["face"]
    assert face.weights["mouthSmileLeft"] == pytest.approx(0.8, abs=0.05)
    assert faceposer.load(tmp_path / "me.npz").character.title == "Me"
    page = (Path(__file__).resolve().parents[2] / "docs" / "api.md").read_text(encoding="utf-8")
    (example,) = [code for code in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "new_head" in code]
    exec(compile(example, "docs/api.md", "exec"), {})


def test_an_edited_head_has_the_clones_of_its_character(
    face: Face, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    low, keys = faceposer.load("low"), KeyFolder(tmp_path / "keys", "man", "low")
    keys.write()
    face.set_weights({"jawOpen": 0.8})
    # A mesh of the source shows the man, not the head that plays.
    shown = face.session.model.instance(face.coefficients)
    write_obj(keys.folder / "source" / "open.obj", shown, face.character.polygons)
    low.set_weights({"jawOpen": 0.6, "mouthSmileLeft": 0.5})
    low.save_pose("Open", keys.folder / "target")
    face.set_attributes(age=0.8, face_width=1.0)
    clone = face.transfer_to("low", "examples", keys=keys.folder)
    np.testing.assert_allclose(clone.vertices, low.vertices, atol=1e-3)
    face.save(tmp_path / "old.json")
    out, options = tmp_path / "out.obj", ("--method", "examples", "--keys", keys.folder)
    status, _, said = run_captured(capsys, "transfer", tmp_path / "old.json", "low", "-o", out, *options)
    assert (status, "outside the keys" in said) == (0, False)
    np.testing.assert_allclose(read_mesh(out).vertices, low.vertices, atol=1e-3)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda _: faceposer.load(5), "A face must be a name or a path, not 5"),
        (lambda _: faceposer.load(None), "A face must be a name or a path, not None"),
        (lambda _: faceposer.load(b"man"), "A face must be a name or a path"),
        (lambda face: faceposer.new_head(base=face), "A face must be a name or a path"),
        (lambda _: faceposer.new_head(attributes=5), "Values of attributes must be given by name"),
        (lambda face: face.set_attributes(5), "Values of attributes must be given by name"),
        (lambda face: face.set_attributes(age=True), "The attribute 'age' must be a number, not True"),
        (lambda face: face.set_attributes({"age": 0.1}, age=0.2), "The attribute 'age' is given twice"),
        (lambda face: face.set_attributes({"nose-length": 0.1}, nose_length=0.2), "'nose-length' is given twice"),
        (lambda face: face.save_character(None), "The path must be a name or a path, not None"),
        (lambda face: face.save(5), "The path must be a name or a path, not 5"),
        (lambda face: face.render(5), "The path must be a name or a path, not 5"),
        (lambda face: face.put_back(path=5), "The path must be a name or a path, not 5"),
        (lambda face: face.export(5), "The path must be a name or a path, not 5"),
        (lambda face: face.take_pose(5), "The path must be a name or a path, not 5"),
        (lambda face: face.apply_pose(5), "A pose must be a name or a path, not 5"),
        (lambda face: face.take_animation(5), "The path must be a name or a path, not 5"),
        (lambda face: face.transfer_to(5), "The character must be a name or a path, not 5"),
        (lambda _: faceposer.find_landmarks(5), "A photo must be a name or a path, not 5"),
        (lambda _: faceposer.find_mesh_landmarks(5), "A mesh must be a name or a path, not 5"),
    ],
)
def test_arguments_of_other_types_are_refused(face: Face, call: Callable[[Any], object], said: str) -> None:
    with pytest.raises(FacePoserError, match=re.escape(said)):
        call(face)


def test_pictures_do_not_replace_the_photos_of_the_session(tmp_path: Path) -> None:
    face, photo = faceposer.load("low"), tmp_path / "me.png"
    Image.new("RGB", (8, 6)).save(photo)
    content = photo.read_bytes()
    with face.session.edit("Open a photo"):
        face.session.replace(replace(face.session.document, photos=(Photo(str(photo), (8, 6)),)))
    for write in (lambda: face.render(photo), lambda: face.put_back(path=photo)):
        with pytest.raises(FacePoserError, match=r"is (also an input|a photo of the session)"):
            write()
    assert photo.read_bytes() == content
