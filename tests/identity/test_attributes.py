"""Attributes of heads are measured truthfully, and set without changing the others."""

from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from faceposer.errors import FacePoserError
from faceposer.identity.attributes import (
    ASYMMETRY,
    ETHNICITIES,
    FORMAT,
    NOUN,
    PERSON,
    HeadAttributes,
    load_attributes,
)
from faceposer.identity.companion_file import read_companion, save_companion
from faceposer.identity.head import HeadMaker
from faceposer.identity.model import IdentityModel
from faceposer.identity.model_file import load_identity_model
from faceposer.model.character_file import load_character
from faceposer.resources import asset_path


@pytest.fixture(scope="module")
def model() -> IdentityModel:
    return load_identity_model()


@pytest.fixture(scope="module")
def attributes() -> HeadAttributes:
    return load_attributes()


@pytest.fixture(scope="module")
def heads(model: IdentityModel) -> list[np.ndarray]:
    """Random heads; the second one is somewhere else in space, the third has detail that no mode explains."""
    skins = [model.instance(row) for row in model.sample(7, 3)]
    skins[1] = Rotation.from_euler("yxz", [40, -20, 10], degrees=True).apply(skins[1]) + [3.0, -8.0, 5.0]
    skins[2] = skins[2] + 0.02 * np.random.default_rng(2).standard_normal(skins[2].shape)
    return skins


def test_average_head_has_value_0_and_average_measurements(model: IdentityModel, attributes: HeadAttributes) -> None:
    values = attributes.measure(model.instance(np.zeros(model.n_coefficients)))
    assert np.abs(list(values.values())).max() < 1e-9
    # The nose's wings of adults are 3 to 4 cm apart, the cheekbones 12 to 16 cm.
    assert 3.0 < attributes["nose-width"].measurement(0.0) < 4.0
    assert 12.0 < attributes["face-width"].measurement(0.0) < 16.0


def test_values_do_not_depend_on_where_the_head_is(attributes: HeadAttributes, heads: list[np.ndarray]) -> None:
    moved = Rotation.from_rotvec([0.3, 1.0, -0.5]).apply(heads[0]) + [10.0, 2.0, -4.0]
    here, there = (list(attributes.measure(head).values()) for head in (heads[0], moved))
    assert here == pytest.approx(there, abs=1e-9)
    assert np.abs(here).max() > 0.1


def test_each_attribute_is_set_and_keeps_all_others(attributes: HeadAttributes, heads: list[np.ndarray]) -> None:
    before = [attributes.measure(head) for head in heads]
    for k, attribute in enumerate(attributes.attributes):
        head, known, value = heads[k % 3], before[k % 3], attribute.limits[k % 2]
        after = attributes.measure(attributes.changed(head, {attribute.name: value}, keep=attributes.names))
        assert after[attribute.name] == pytest.approx(value, abs=1e-3)
        for other in attributes.attributes:
            exempt = attribute.name in ETHNICITIES and other.name in ETHNICITIES
            if other is not attribute and not exempt:
                share = abs(after[other.name] - known[other.name]) / (other.limits[1] - other.limits[0])
                assert share < 0.005, (attribute.name, other.name)


def test_by_default_attributes_of_the_face_nearly_keep_the_others(
    attributes: HeadAttributes, heads: list[np.ndarray]
) -> None:
    before = attributes.measure(heads[0])
    for name in ("face-width", "chin-height", "upper-lip"):
        value = before[name] + 1.0
        after = attributes.measure(attributes.changed(heads[0], {name: value}))
        assert after[name] == pytest.approx(value, abs=1e-3)
        shares = [
            abs(after[other.name] - before[other.name]) / (other.limits[1] - other.limits[0])
            for other in attributes.attributes
            if other.name != name
        ]
        assert 0.001 < max(shares) < 0.1


def test_attributes_of_the_mouth_keep_the_others_when_lips_are_closed(
    model: IdentityModel, attributes: HeadAttributes
) -> None:
    lips = HeadMaker.shipped().lips
    for seed in (604, 605, 610):
        head = model.instance(model.sample(seed)[0])
        before = attributes.measure(lips.close_lips(head))
        for name, value in product(("chin-height", "lower-lip", "jaw-height"), (-1.0, 1.0)):
            after = attributes.measure(lips.close_lips(attributes.changed(head, {name: value})))
            for other in attributes.attributes:
                share = abs(after[other.name] - before[other.name]) / (other.limits[1] - other.limits[0])
                assert other.name == name or share < 0.1, (seed, name, value, other.name)


def test_attributes_of_the_person_change_the_face_and_keep_each_other(
    attributes: HeadAttributes, heads: list[np.ndarray]
) -> None:
    before = attributes.measure(heads[0])
    after = attributes.measure(attributes.changed(heads[0], {"gender": -1.2}))
    people = {attribute.name for attribute in attributes.attributes if attribute.group == PERSON} - {"gender"}
    assert after["gender"] == pytest.approx(-1.2, abs=1e-3)
    assert all(after[name] == pytest.approx(before[name], abs=1e-3) for name in people)
    assert max(abs(after[name] - before[name]) for name in after.keys() - people - {"gender"}) > 0.1


def test_several_values_are_met_together(attributes: HeadAttributes, heads: list[np.ndarray]) -> None:
    wanted = {"age": 0.5, "nose-length": -0.4, "mouth-width": 0.3, "asian": 0.4, "african": -0.3}
    after = attributes.measure(attributes.changed(heads[2], wanted))
    assert {name: after[name] for name in wanted} == pytest.approx(wanted, abs=2e-3)
    assert sum(after[name] for name in ETHNICITIES) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("name", "one", "other"),
    [
        ("mouth-width", "8.3", "8.4"),
        ("nose-width", "9.1", "9.2"),
        ("jaw-width", "2.13", "2.14"),
        ("ear-size", "10.1", "10.5"),
    ],
)
def test_lengths_grow_between_feature_points(
    model: IdentityModel, attributes: HeadAttributes, name: str, one: str, other: str
) -> None:
    """The points of MPEG-4 are not those that are measured, but near them."""
    points = load_character("man").feature_points
    average = model.instance(np.zeros(model.n_coefficients))
    wider = attributes.changed(average, {name: 1.0})
    before, after = (float(np.linalg.norm(head[points[one]] - head[points[other]])) for head in (average, wider))
    assert after - before == pytest.approx(attributes[name].scale, rel=0.3)


def test_no_head_of_the_model_with_the_same_measurements_is_as_likely(
    model: IdentityModel, attributes: HeadAttributes
) -> None:
    """Equation (3): the change is the shortest in the metric of the statistics."""
    average = model.instance(np.zeros(model.n_coefficients))
    changed = attributes.changed(average, {"jaw-width": 0.5}, keep=attributes.names)
    found = model.project(attributes.template.control(changed)).coefficients
    values = attributes.measure(model.instance(found))
    values.pop(ASYMMETRY)
    other = model.instance(found + 0.3 * np.random.default_rng(0).standard_normal(len(found)))
    same = attributes.changed(other, values, keep=attributes.names)
    again = model.project(attributes.template.control(same)).coefficients
    assert np.linalg.norm(found) < np.linalg.norm(again)


def test_left_and_right_change_alike(model: IdentityModel, attributes: HeadAttributes) -> None:
    average = model.instance(np.zeros(model.n_coefficients))
    template = attributes.template
    for name in ("gender", "eye-tilt", "ear-protrusion"):
        change = attributes.changed(average, {name: 1.0}) - average
        mirrored = change[template.mirror] * [-1.0, 1.0, 1.0]
        assert np.abs(change - mirrored).max() < 2e-3


def test_asymmetry_is_taken_out_and_put_in(model: IdentityModel, attributes: HeadAttributes) -> None:
    average = model.instance(np.zeros(model.n_coefficients))
    uneven = attributes.changed(average, {ASYMMETRY: 0.8}, seed=3)
    values = attributes.measure(uneven)
    assert values.pop(ASYMMETRY) == pytest.approx(0.8, rel=0.05)
    assert np.abs(list(values.values())).max() < 0.02
    assert attributes.measure(attributes.changed(uneven, {ASYMMETRY: 0.2}))[ASYMMETRY] == pytest.approx(0.2, rel=0.05)
    assert not np.allclose(uneven, attributes.changed(average, {ASYMMETRY: 0.8}, seed=4), atol=1e-3)


def test_bad_input_is_named(attributes: HeadAttributes, heads: list[np.ndarray]) -> None:
    with pytest.raises(FacePoserError, match="no attribute 'beauty'"):
        attributes.changed(heads[0], {"beauty": 1.0})
    with pytest.raises(FacePoserError, match="'age' must be a finite number"):
        attributes.changed(heads[0], {"age": np.nan})
    with pytest.raises(FacePoserError, match="17259 finite positions"):
        attributes.measure(heads[0][:-1])


def test_damaged_files_are_named(tmp_path: Path, model: IdentityModel) -> None:
    meta, arrays = read_companion(asset_path("identity-attributes.npz"), FORMAT, NOUN)
    path = tmp_path / "attributes.npz"
    save_companion(path, FORMAT, NOUN, meta, {**arrays, "weights": arrays["weights"][:5]})
    with pytest.raises(FacePoserError, match="do not belong together"):
        load_attributes(path, model)
    save_companion(path, "faceposer.other", NOUN, meta, {})
    with pytest.raises(FacePoserError, match="format is not faceposer"):
        load_attributes(path, model)
    path.write_bytes(b"no archive")
    with pytest.raises(FacePoserError, match="damaged"):
        load_attributes(path, model)
    with pytest.raises(FacePoserError, match="cannot be read"):
        load_attributes(tmp_path / "none.npz", model)
