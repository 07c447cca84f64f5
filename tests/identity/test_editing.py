"""Editing of the head of a character."""

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.json_documents import convert
from faceposer.identity.editing import HeadEditor, edited_character
from faceposer.identity.head_choices import changed_head
from faceposer.identity.identity import MOST, Identity, IdentityJson, SkinTexture, is_editable
from faceposer.identity.skin_layers import SkinLayers
from faceposer.identity.texture_model import load_texture_model
from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel


@pytest.fixture(scope="module")
def editor(woman: FaceModel) -> HeadEditor:
    return HeadEditor(woman.character)


def test_a_characters_own_head_is_its_skin(editor: HeadEditor) -> None:
    skin = editor.character.vertices[: len(editor.skin(editor.own))]
    # Rounded to steps of 2 micrometres.
    np.testing.assert_allclose(editor.skin(editor.own), skin, atol=3e-4)
    assert editor.with_head(editor.own) is editor.character


def test_a_head_near_the_own_one_is_near_the_character(editor: HeadEditor) -> None:
    changed = editor.with_head(editor.own.mixed(editor.average, 1e-3))
    distances = np.linalg.norm(changed.vertices - editor.character.vertices, axis=1)
    assert 0.0 < distances.max() < 0.02
    moved = np.linalg.norm(changed.shapes - editor.character.shapes, axis=2)
    assert moved.max() < 0.15


def test_lashes_of_a_random_head_remain_when_it_is_edited(editor: HeadEditor) -> None:
    # Its outermost vertices of the lids' edges are not the man's, on one side.
    base = editor.with_head(editor.random(7))
    again = HeadEditor(base)
    changed = again.with_head(again.own.mixed(again.average, 1e-3))
    for name in ("lashes_left", "lashes_right"):
        ids = slice(*base.part(name).vertices)
        np.testing.assert_allclose(changed.vertices[ids], base.vertices[ids], atol=0.03, err_msg=name)


def test_attributes_are_set_and_the_others_stay(editor: HeadEditor) -> None:
    start = editor.random(3)
    before = editor.measure(start)
    after = editor.measure(editor.with_attributes(start, {"nose-length": before["nose-length"] + 0.5}))
    assert after["nose-length"] - before["nose-length"] == pytest.approx(0.5, abs=1e-2)
    for name, value in before.items():
        if name not in ("nose-length", "asymmetry"):
            assert after[name] == pytest.approx(value, abs=2e-2), name


def test_setting_an_attribute_back_returns_the_head(editor: HeadEditor) -> None:
    there = editor.with_attributes(editor.own, {"age": 0.8})
    back = editor.with_attributes(there, {"age": editor.measure(editor.own)["age"]})
    np.testing.assert_allclose(editor.skin(back), editor.skin(editor.own), atol=1e-2)


def test_random_heads_are_reproducible_and_keep_what_is_locked(editor: HeadEditor) -> None:
    assert editor.random(5).same(editor.random(5))
    assert not editor.random(5).same(editor.random(6))
    nose = editor.random(5, editor.own, free=["nose"])
    row = editor.segment_names.index("nose")
    others = [i for i in range(len(editor.segment_names)) if i != row]
    np.testing.assert_array_equal(nose.shape[others], editor.own.shape[others])
    np.testing.assert_array_equal(nose.shape[row], editor.random(5).shape[row])
    # Far from the nose, not a vertex moves.
    ear = editor.character.regions["ear_left"]
    np.testing.assert_allclose(editor.skin(nose)[ear], editor.skin(editor.own)[ear], atol=5e-4)


def test_average_caricature_and_mixtures_lie_on_a_line(editor: HeadEditor) -> None:
    own = editor.own
    assert np.abs(editor.skin(own.scaled(0.0)) - editor.skin(editor.average)).max() < 1e-9
    halfway = editor.skin(own.mixed(editor.average, 0.5))
    np.testing.assert_allclose(halfway, editor.skin(own.scaled(0.5)), atol=3e-4)
    assert editor.distance(editor.average) == 0.0
    assert editor.distance(own.scaled(2.0)) == pytest.approx(2.0 * editor.distance(own))
    assert editor.distance(editor.random(1)) == pytest.approx(1.0, abs=0.3)


def test_the_skin_follows_age_and_gender(editor: HeadEditor) -> None:
    model = load_texture_model()
    young = dataclasses.replace(
        editor.average,
        texture=SkinTexture(
            (-0.5,) + (0.0,) * (model.n_coefficients - 1), SkinLayers(beard=0.7, brow_colour=(0.1, 0.1, 0.1))
        ),
    )
    old = editor.with_attributes(young, {"age": 1.0})
    age = editor.measure(young)["age"]
    assert model.label(old.texture.coefficients, "age") == pytest.approx(min(1.0 - age, 1.2), abs=1e-6)
    assert model.tone(old.texture.coefficients) == pytest.approx(-0.5)
    assert np.mean(old.texture.layers.hair_colour) > np.mean(young.texture.layers.hair_colour) + 0.2
    assert np.mean(old.texture.layers.brow_colour) > 0.2
    again = editor.with_attributes(old, {"age": age})
    np.testing.assert_allclose(again.texture.coefficients, young.texture.coefficients, atol=0.02)
    np.testing.assert_allclose(again.texture.layers.hair_colour, young.texture.layers.hair_colour, atol=0.02)
    woman = editor.with_attributes(young, {"gender": 1.0})
    assert woman.texture.layers.beard == 0.0
    assert model.label(woman.texture.coefficients, "gender") > 0.5
    assert editor.with_attributes(young, {"age": 1.0}, skin_follows=False).texture is young.texture
    assert editor.with_attributes(young, {"weight": 1.0}).texture is young.texture
    assert editor.with_attributes(editor.own, {"age": 1.0}).texture is None
    toned = changed_head(editor, editor.own, values={"age": 1.2}, tone=0.5).texture
    own = editor.own_texture()
    assert model.tone(toned.coefficients) == pytest.approx(0.5)
    assert model.label(toned.coefficients, "age") > model.label(own.coefficients, "age") + 0.5


@pytest.mark.parametrize("factor", [1.7, 2.0])
def test_caricatures_do_not_fold_over(editor: HeadEditor, factor: float) -> None:
    triangles = editor.template.triangles

    def normals(identity: Identity) -> NDArray[np.float64]:
        corners = editor.aligned_skin(identity)[triangles]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        unit: NDArray[np.float64] = across / np.linalg.norm(across, axis=1, keepdims=True)
        return unit

    turned = np.einsum("fd,fd->f", normals(editor.own), normals(editor.own.scaled(factor)))
    # All of the detail, scaled, turns over 52 and 306.
    assert np.count_nonzero(turned < 0.0) < 10


def test_identities_survive_their_file(editor: HeadEditor) -> None:
    identity = dataclasses.replace(
        editor.own, texture=SkinTexture((0.5, -1.25), SkinLayers(hair="none", beard=0.3, brow_colour=(0.1, 0.2, 0.3)))
    )
    other_eyes = dataclasses.replace(identity.texture, eyes=(0.2, 0.3, 0.4))
    for each in (identity, dataclasses.replace(identity, texture=other_eyes)):
        again = convert(each.to_json(), IdentityJson).identity()
        assert again.same(each)
        assert not again.same(editor.own)
    assert not again.same(identity)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"detail": "AAAA"}, "detail"),
        ({"detail": "é"}, "detail"),
        ({"shape": [[0.0], [0.0, 1.0]]}, "shape"),
        ({"shape": [[1e9]]}, "shape"),
        ({"shape": []}, "shape"),
        ({"texture": {"coefficients": [0.0], "layers": {"hair": "mohawk"}}}, "mohawk"),
        ({"texture": {"coefficients": [0.0], "layers": {"beard": 2.0}}}, "beard"),
    ],
)
def test_damaged_identities_are_refused(editor: HeadEditor, change: dict[str, object], message: str) -> None:
    with pytest.raises(FacePoserError, match=message):
        convert({**editor.own.to_json(), **change}, IdentityJson)


def test_identities_of_another_model_are_refused(editor: HeadEditor) -> None:
    with pytest.raises(FacePoserError, match="another version of the model"):
        edited_character(editor.character, Identity.of(np.zeros((2, 3))))


def test_heads_that_a_file_could_not_hold_are_refused(editor: HeadEditor) -> None:
    far = editor.random(1).scaled(MOST / np.abs(editor.random(1).shape).max() * 1.01)
    with pytest.raises(FacePoserError, match="exaggerate it less"):
        edited_character(editor.character, far)
    with pytest.raises(FacePoserError):
        convert(far.to_json(), IdentityJson)


def test_people_are_editable_and_others_are_not(man: FaceModel, low: FaceModel, creature: FaceModel) -> None:
    for name in ("man", "woman", "amara", "walter"):
        assert is_editable(load_character(name)), name
    # The same mesh with other shapes, as training on exported poses makes it.
    given = man.character
    fewer = dataclasses.replace(
        given, shapes=given.shapes[:20], shape_names=given.shape_names[:20], shape_limits=given.shape_limits[:20]
    )
    turned = dataclasses.replace(given, polygons=given.polygons[:, [1, 2, 3, 0]])
    for character in (low.character, creature.character, fewer, turned):
        assert not is_editable(character)
        with pytest.raises(FacePoserError, match="cannot be edited"):
            HeadEditor(character)


@pytest.mark.parametrize("data", [b"not an image", b"\x89PNG\r\n\x1a\n" + b"\0" * 40])
def test_a_damaged_image_of_the_skin_gets_one_sentence(man: FaceModel, data: bytes) -> None:
    damaged = dataclasses.replace(man.character, textures={**man.character.textures, "skin": data})
    with pytest.raises(FacePoserError, match="image of the skin of 'Man' cannot be read"):
        HeadEditor(damaged).own_texture()


def test_the_preview_is_like_the_character(editor: HeadEditor, woman: FaceModel) -> None:
    identity = editor.random(3)
    whole = woman.with_character(editor.with_head(identity))
    weights = {"jawOpen": 0.4, "mouthSmileLeft": 0.6, "browInnerUp": 0.5}
    pose = woman.coefficients_of(np.array([weights.get(name, 0.0) for name in woman.character.shape_names]))
    shown = editor.preview(woman, pose, identity)
    skin = slice(0, editor.template.n_skin)
    away = np.linalg.norm(shown - whole.surface(pose), axis=1)[skin]
    assert np.median(away) < 0.03
    assert np.percentile(away, 99.0) < 0.4
    still = np.linalg.norm(editor.preview(woman, woman.neutral(), identity) - whole.character.vertices, axis=1)[skin]
    assert still.max() < 1e-3
