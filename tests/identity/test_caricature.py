"""Distinctiveness scales what distinguishes a head from the average."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from faceposer.errors import FacePoserError
from faceposer.identity.caricature import distinctiveness, exaggerated, with_distinctiveness
from faceposer.identity.model import IdentityModel
from faceposer.identity.model_file import load_identity_model


@pytest.fixture(scope="module")
def model() -> IdentityModel:
    return load_identity_model()


def test_random_heads_are_about_as_distinctive_as_people(model: IdentityModel) -> None:
    found = [distinctiveness(model, row) for row in model.sample(1, 50)]
    assert np.mean(found) == pytest.approx(1.0, abs=0.05)
    assert distinctiveness(model, np.zeros(model.n_coefficients)) == 0.0


def test_distinctiveness_is_set(model: IdentityModel) -> None:
    head = model.sample(2)[0]
    wanted = with_distinctiveness(model, head, 1.7)
    assert distinctiveness(model, wanted) == pytest.approx(1.7)
    assert np.corrcoef(head, wanted)[0, 1] == pytest.approx(1.0)
    segments = np.stack([head, 2.0 * head])
    assert distinctiveness(model, with_distinctiveness(model, segments, 0.5)) == pytest.approx(0.5)
    assert not with_distinctiveness(model, np.zeros(len(head)), 2.0).any()


def test_caricature_of_vertices_is_that_of_coefficients_wherever_the_head_is(model: IdentityModel) -> None:
    head = model.sample(3)[0]
    skin = model.instance(head)
    turn = Rotation.from_rotvec([0.2, 0.9, 0.1])
    moved = exaggerated(model, turn.apply(skin) + [1.0, 2.0, 3.0], 1.7)
    back = turn.inv().apply(moved - [1.0, 2.0, 3.0])
    # The head's own best alignment differs a little from that of the model, whose modes are aligned above the neck.
    difference = np.linalg.norm(back - model.instance(1.7 * head), axis=1).mean()
    assert difference < 0.25 * np.linalg.norm(model.instance(1.7 * head) - skin, axis=1).mean()
    assert np.abs(exaggerated(model, skin, 1.0) - skin).max() < 1e-9


def test_bad_factors_are_named(model: IdentityModel) -> None:
    skin = model.instance(np.zeros(model.n_coefficients))
    for factor in (-0.5, np.nan, np.inf):
        with pytest.raises(FacePoserError, match="distinctiveness must be 0 or more"):
            exaggerated(model, skin, factor)
    with pytest.raises(FacePoserError, match="finite positions"):
        exaggerated(model, skin[:-1], 1.0)
