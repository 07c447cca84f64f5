"""The mapping from feature points to meshes."""

import numpy as np
import pytest

from faceposer.model.face_model import FaceModel
from faceposer.sketch.mapping import DualPPCA, MeshMapping
from faceposer.sketch.training_poses import TrainingPoses


def test_dual_ppca_is_ppca() -> None:
    rng = np.random.default_rng(0)
    data, q = rng.normal(size=(12, 5)) @ rng.normal(size=(5, 30)) + 0.05 * rng.normal(size=(12, 30)), 4
    fitted = DualPPCA.fit(data, q)
    spreads, axes = np.linalg.eigh(np.cov(data.T, bias=True))
    spreads, axes = spreads[::-1], axes[:, ::-1][:, :q]
    assert fitted.variance == pytest.approx(spreads[q:].sum() / (30 - q))
    assert fitted.factors @ fitted.factors.T == pytest.approx(axes * (spreads[:q] - fitted.variance) @ axes.T, abs=1e-9)
    # (9) inverts (8): what remains is the orthogonal projection on the subspace.
    projected = data.mean(axis=0) + (data - data.mean(axis=0)) @ axes @ axes.T
    assert fitted.reconstructed(fitted.latents(data)) == pytest.approx(projected)


def _relative(model: FaceModel, found: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Displacement of all vertices that is wrong, relative to the true one, of each pose."""
    wrong, right = ((p.astype(np.float32) @ model.basis) for p in (found - true, true))
    return np.linalg.norm(wrong, axis=1) / np.linalg.norm(right, axis=1)


@pytest.mark.parametrize("character", ["low", "creature"])
def test_all_training_poses_are_reconstructed(character: str, request: pytest.FixtureRequest) -> None:
    # Figure 8 of the paper.
    model: FaceModel = request.getfixturevalue(character)
    training = TrainingPoses.of(model, 36)
    mapping = MeshMapping.fit(training.points, training.coefficients, (60, 60))
    found = mapping.coefficients(training.points)
    assert np.abs(found[0]).max() < 1e-3 * np.abs(training.coefficients).max()
    assert _relative(model, found[1:], training.coefficients[1:]).max() < 1e-3


@pytest.mark.parametrize(
    ("character", "count", "median"), [("low", 36, 0.15), ("low", 300, 1e-3), ("creature", 300, 0.05)]
)
def test_unseen_poses(character: str, count: int, median: float, request: pytest.FixtureRequest) -> None:
    model: FaceModel = request.getfixturevalue(character)
    training = TrainingPoses.of(model, count)
    mapping = MeshMapping.fit(training.points, training.coefficients, (60, 60))
    unseen = _unseen(model, training)
    errors = _relative(model, mapping.coefficients(unseen.points), unseen.coefficients)
    assert np.median(errors) < median


def _unseen(model: FaceModel, training: TrainingPoses) -> TrainingPoses:
    others = TrainingPoses.of(model, 260, seed=7)
    known = {p.tobytes() for p in training.coefficients}
    new = [i for i, p in enumerate(others.coefficients) if i >= 130 and p.tobytes() not in known]
    assert len(new) > 60
    return others.subset(np.array(new, dtype=np.intp))
