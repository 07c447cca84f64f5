from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.picking import pick_pixels
from faceposer.identity.anatomy.eyeballs import ball_of
from faceposer.identity.anatomy.local_maps import LocalMaps
from faceposer.identity.character import character_of
from faceposer.identity.editing import head_editor
from faceposer.identity.head import HeadMaker
from faceposer.identity.identity import GROTESQUE
from faceposer.identity.model_file import load_identity_model
from faceposer.model.character import Character
from faceposer.model.character_file import load_character
from faceposer.model.contact.measure import penetration_mm
from faceposer.model.contact.step import ContactStep
from faceposer.model.framing import face_view
from scripts.study_heads import blink_gap_mm

N_SKIN = 17259


def visible(character: Character) -> NDArray[np.int32]:
    """Return the vertices of the skin that are not inside the eyeballs or the mouth."""
    ids = np.unique(np.concatenate([ids for ids in character.regions.values() if ids.max() < N_SKIN]))
    for name in ("eye_left", "eye_right"):
        centre, radius = ball_of(character.vertices[slice(*character.part(name).vertices)].astype(float))
        ids = ids[np.linalg.norm(character.vertices[ids] - centre, axis=1) > radius]
    return ids


@pytest.fixture(scope="module")
def man() -> Character:
    return load_character("man")


@pytest.fixture(scope="module")
def random_head() -> Character:
    heads = load_identity_model()
    return character_of(heads.instance(heads.sample(7)[0]), name="seven", title="Seven", credits="Drawn.")


def test_the_man_is_made_of_his_own_skin(man: Character) -> None:
    again = character_of(man.vertices[:N_SKIN], name="man", title="Man")
    np.testing.assert_allclose(again.vertices, man.vertices, atol=1e-4)
    shown = np.concatenate([visible(man), np.arange(N_SKIN, len(man.vertices))])
    np.testing.assert_allclose(again.shapes[:, shown], man.shapes[:, shown], atol=5e-3)
    assert again.textures == man.textures
    assert again.feature_points == man.feature_points
    assert again.statistics is None


def test_a_larger_man_has_larger_expressions(man: Character) -> None:
    larger = character_of(1.3 * man.vertices[:N_SKIN].astype(float), name="giant", title="Giant")
    shown = visible(man)
    for name in ("mouthSmileLeft", "browInnerUpRight", "jawOpen", "mouthClose", "cheekPuffLeft"):
        row = man.shape_names.index(name)
        np.testing.assert_allclose(larger.shapes[row, shown], 1.3 * man.shapes[row, shown], atol=0.02, err_msg=name)
    ids = slice(*man.part("tongue").vertices)
    np.testing.assert_allclose(larger.shapes[:, ids], 1.3 * man.shapes[:, ids], atol=1e-3)


def test_the_woman_of_her_skin_alone_is_like_the_woman() -> None:
    woman = load_character("woman")
    made = character_of(woman.vertices[:N_SKIN], name="w", title="W")
    for name, millimetres in (("teeth_upper", 0.3), ("tongue", 0.3), ("eye_left", 1.5), ("lashes_right", 2.0)):
        ids = slice(*woman.part(name).vertices)
        away = 10.0 * np.linalg.norm(made.vertices[ids] - woman.vertices[ids], axis=1)
        assert away.max() < millimetres, name
    shown = visible(woman)
    errors = 10.0 * np.linalg.norm(made.shapes[:, shown] - woman.shapes[:, shown], axis=2)
    truth = 10.0 * np.linalg.norm(woman.shapes[:, shown], axis=2)
    # Her own shapes are not scaled by the size of her face.
    assert np.sqrt(np.mean(errors**2)) < 0.12 * np.sqrt(np.mean(truth**2))


def test_blinks_of_a_random_head_close(random_head: Character) -> None:
    for side in ("Left", "Right"):
        assert blink_gap_mm(random_head, side) < 0.05
        assert blink_gap_mm(random_head, side, 0.8) > 0.2, "an eye that is not quite closed has a gap"


def test_nothing_penetrates_in_a_random_head(random_head: Character) -> None:
    step = ContactStep.of(random_head)
    row = random_head.shape_names.index
    smile = ("mouthSmileLeft", "mouthSmileRight", "mouthLowerDownLeft", "mouthStretchRight")
    for names in (smile, ("jawOpen", "mouthFunnel"), ("eyeBlinkLeft", "eyeWideRight", "mouthRollLower")):
        vertices = random_head.vertices + sum(random_head.shapes[row(name)] for name in names)
        depths = penetration_mm(random_head, step.apply(vertices.astype(np.float32)))
        assert max(depths.values()) < 0.1, (names, depths)


def test_lips_touch_as_the_mans_at_rest_and_over_an_open_jaw(man: Character, random_head: Character) -> None:
    lips = HeadMaker.shipped().lips
    rows = [man.shape_names.index(name) for name in ("jawOpen", "mouthClose")]
    rest, over_jaw = (
        [lips.gaps(character.vertices[:N_SKIN] + offset(character)) for character in (man, random_head)]
        for offset in (lambda _: 0.0, lambda character: character.shapes[rows, :N_SKIN].sum(axis=0))
    )
    apart = (rest[1] - rest[0])[29:-29]
    assert apart.max() < 0.04, "they are open"
    assert apart.min() > -0.15, "they overlap"
    changes = [jaw - still for jaw, still in zip(over_jaw, rest, strict=True)]
    np.testing.assert_allclose(changes[1][8:-8], changes[0][8:-8], atol=0.12)


def test_open_lips_are_closed_and_the_folded_ends_of_closed_ones_stay(man: Character) -> None:
    heads, lips = load_identity_model(), HeadMaker.shipped().lips
    skin = heads.instance(heads.sample(6)[0])
    closed = lips.close_lips(skin)
    ends = np.abs(skin[:, 0]) > 1.9
    np.testing.assert_allclose(closed[ends], skin[ends], atol=2e-3)
    still = man.vertices[:N_SKIN].astype(float)
    ajar = still + 0.15 * man.shapes[man.shape_names.index("jawOpen"), :N_SKIN]
    before, after = ((lips.gaps(each) - lips.gaps(still))[29:-29] for each in (ajar, lips.close_lips(ajar)))
    assert before.min() > 0.2
    assert after.max() < 0.1


def test_back_teeth_rise_with_upturned_corners_and_stay_rigid_on_the_jaw(man: Character) -> None:
    heads, maker = load_identity_model(), HeadMaker.shipped()
    assert maker.head(man.vertices[:N_SKIN]).mouth.rise == 0.0
    made = maker.head(heads.instance(heads.sample(2)[0]))
    assert made.mouth.rise > 0.2
    upper, lower = (slice(*man.part(f"teeth_{jaw}").vertices) for jaw in ("upper", "lower"))
    change = made.vertices - made.mouth.scale * man.vertices
    back = man.vertices[:, 2] - man.vertices[upper, 2].max() < -2.0
    for teeth in (upper, lower):
        rise = change[teeth][back[teeth], 1].mean() - change[teeth][~back[teeth], 1].mean()
        assert rise > 0.3 * made.mouth.rise, "both rows rise, so that they still meet"
    opened = made.vertices[lower] + maker.shapes(made)[man.shape_names.index("jawOpen"), lower]
    pairs = np.random.default_rng(0).integers(0, len(opened), (2, 200))
    lengths = [np.linalg.norm(points[pairs[0]] - points[pairs[1]], axis=1) for points in (made.vertices[lower], opened)]
    np.testing.assert_allclose(lengths[1], lengths[0], atol=2e-3)


def test_the_lining_of_the_mouth_stays_inside_the_skin(man: Character) -> None:
    heads, lips = load_identity_model(), HeadMaker.shipped().lips
    skin = lips.close_lips(heads.instance(heads.sample(15)[0]))
    assert lips.lining.depth(skin).min() < 0.0, "the fold below the lip is deep"
    made = character_of(skin, name="fifteen", title="Fifteen")
    rest = made.vertices[:N_SKIN].astype(float)
    assert lips.lining.depth(rest).min() > 0.15
    pucker = {"mouthPucker": 1.0, "mouthFunnel": 0.5, "jawForward": 0.3}
    rows = [man.shape_names.index(name) for name in pucker]
    posed = rest + np.tensordot(list(pucker.values()), made.shapes[rows, :N_SKIN].astype(float), 1)
    assert lips.lining.depth(posed).min() > 0.05


def test_nothing_of_the_mouth_is_seen_through_the_neck_of_a_caricature(man: Character) -> None:
    editor, maker = head_editor(man), HeadMaker.shipped()
    skin = editor.skin(editor.random(13, editor.own, None, 0.8).scaled(GROTESQUE))
    made = maker.head(skin)
    inside = np.zeros(len(man.vertices), dtype=bool)
    inside[maker.lips.cavity.ids] = True
    inside[slice(*man.part("throat").vertices)] = True
    below = replace(face_view(man), pitch=np.radians(-60.0)).camera((200, 200))
    pixels = np.stack(np.meshgrid(np.arange(200.0), np.arange(200.0)), axis=-1).reshape(-1, 2)

    def seen(vertices: NDArray[np.float64]) -> int:
        points, _ = pick_pixels(vertices, man.triangles, below, pixels)
        return int(inside[man.triangles[points.faces]].all(axis=1).sum())

    before = made.vertices.copy()
    before[:N_SKIN] = skin
    assert seen(before) > 50, "the neck is too thin for the mouth's cavity"
    assert seen(made.vertices) <= 2
    # The lining moves with the skin that it was drawn below.
    shapes = maker.shapes(made)
    for name in ("mouthFrownLeft", "noseSneerRight", "jawForward"):
        assert seen(made.vertices + shapes[man.shape_names.index(name)]) <= 5, name


def test_the_cavity_of_the_man_and_of_usual_heads_is_left_alone(man: Character) -> None:
    editor, maker = head_editor(man), HeadMaker.shipped()
    assert maker.head(man.vertices[:N_SKIN]).lining.share.max() < 1e-6
    usual = maker.head(editor.skin(editor.random(4, editor.own, None, 0.8)))
    assert usual.lining.share.max() < 1e-6
    assert usual.throat.share.max() < 1e-6


def test_the_lining_stays_inside_in_sums_of_weak_shapes() -> None:
    heads, lips = load_identity_model(), HeadMaker.shipped().lips
    made = character_of(heads.instance(heads.sample(0, 25)[24]), name="deep", title="Deep")
    weights = {"mouthPucker": 0.74, "mouthFunnel": 0.37, "jawOpen": 0.34, "mouthClose": 0.33}
    rows = [made.shape_names.index(name) for name in weights]
    offsets = np.tensordot(list(weights.values()), made.shapes[rows, :N_SKIN].astype(float), 1)
    for share in (0.5, 1.0, 1.1):
        assert lips.lining.depth(made.vertices[:N_SKIN] + share * offsets).min() > 0.0


def test_eyeballs_are_between_the_lids(random_head: Character) -> None:
    points = random_head.feature_points
    for side, upper, lower in (("left", "3.1", "3.3"), ("right", "3.2", "3.4")):
        centre, radius = ball_of(random_head.vertices[slice(*random_head.part(f"eye_{side}").vertices)].astype(float))
        for name in (upper, lower):
            distance = np.linalg.norm(random_head.vertices[points[name]] - centre)
            assert 1.02 * radius < distance < 1.35 * radius, "the lid's edge is in front of the ball"


def test_textures_and_credits_are_taken(man: Character) -> None:
    made = character_of(
        man.vertices[:N_SKIN], name="me", title="Me", textures={"skin": man.textures["eye"]}, credits="A scan."
    )
    assert made.textures["skin"] == man.textures["eye"]
    assert made.textures["teeth"] == man.textures["teeth"]
    assert made.credits.startswith("A scan. Mesh")


def test_other_skins_are_refused(man: Character) -> None:
    skin = man.vertices[:N_SKIN].astype(float)
    for wrong, reason in ((skin[:-1], "shape"), (skin * np.nan, "not finite"), (0.01 * skin, "centimetres")):
        with pytest.raises(FacePoserError, match=reason):
            character_of(wrong, name="x", title="X")


def test_local_maps_recover_an_affine_map() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(-4.0, 4.0, (3000, 3))
    linear = np.array([[1.2, 0.1, 0.0], [0.0, 0.9, 0.1], [0.05, 0.0, 1.1]])
    maps = LocalMaps(points, np.arange(3000, dtype=np.int32), 50)(points @ linear.T + [1.0, 2.0, 3.0])
    np.testing.assert_allclose(maps, np.broadcast_to(linear, maps.shape), atol=0.02)
