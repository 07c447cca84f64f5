"""The model is fitted to a scan whose head and expression are known."""

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.alignment import Similarity, rigid_alignment
from faceposer.identity.scans.basis import HeadBasis
from faceposer.identity.scans.equations import moved, pose_columns, within_bounds
from faceposer.identity.scans.fitting import HeadFit, fit_head
from faceposer.identity.scans.scan import PlacedScan, ScanLandmarks, placed_scan
from faceposer.landmarks.drawing import PaintedMesh
from faceposer.progress import CancelledError, Progress
from tests.identity.scans.conftest import SmilingScan


@pytest.fixture(scope="module")
def placed(basis: HeadBasis, smiling: SmilingScan) -> PlacedScan:
    """Return the scan, with its triangles turned over, in the frame of the model."""
    inwards = PaintedMesh(smiling.mesh.vertices, smiling.mesh.triangles[:, ::-1])
    return placed_scan(basis, inwards, smiling.landmarks)


@pytest.fixture(scope="module")
def fit(basis: HeadBasis, placed: PlacedScan) -> HeadFit:
    """Return the fit to it."""
    return fit_head(basis, [placed.data])


def test_a_smiling_scan_gives_the_neutral_head(basis: HeadBasis, smiling: SmilingScan, fit: HeadFit) -> None:
    face = basis.trust > 0.9
    truth = smiling.neutral[face]

    def error(head: np.ndarray) -> float:
        moved = rigid_alignment(head[face], truth, scale=True).apply(head[face])
        return 10.0 * float(np.linalg.norm(moved - truth, axis=1).mean())

    assert error(fit.neutral) < 0.25
    # The model explains the scan, so that segments need not differ.
    assert not fit.local.any()
    assert error(basis.mean) > 1.5
    found = dict(zip(basis.expression_names, fit.scans[0].weights, strict=True))
    for name in ("mouthSmileLeft", "mouthSmileRight"):
        assert 0.5 < found[name] < 0.9
    for name in ("eyeBlinkLeft", "eyeBlinkRight"):
        assert found[name] > 0.6
    others = [weight for name, weight in found.items() if not name.startswith(("mouthSmile", "eyeBlink"))]
    assert max(others) < 0.15


def test_triangles_are_turned_to_the_outside(placed: PlacedScan, basis: HeadBasis) -> None:
    closest = placed.data.surface.closest(placed.data.places)
    normals = basis.normals(basis.mean)[placed.data.rows[:, 0]]
    assert np.median(np.einsum("md,md->m", closest.normals, normals)) > 0.8


def test_landmarks_elsewhere_are_refused_in_one_sentence(basis: HeadBasis, smiling: SmilingScan) -> None:
    far = ScanLandmarks(smiling.landmarks.points + 1e4, smiling.landmarks.spread, {})
    with pytest.raises(FacePoserError, match="no surface around the landmarks of 'me"):
        placed_scan(basis, smiling.mesh, far, "me.obj")


def test_it_can_be_cancelled(basis: HeadBasis, placed: PlacedScan) -> None:
    with pytest.raises(CancelledError):
        fit_head(basis, [placed.data], progress=Progress(cancelled=lambda: True))


def test_columns_of_the_pose_are_its_derivative() -> None:
    places = np.random.default_rng(0).normal(size=(5, 3))
    columns, step = pose_columns(places), 1e-6
    identity = Similarity(np.eye(3), np.zeros(3), np.array(1.0))
    for k in range(7):
        pose = np.zeros(7)
        pose[k] = step
        difference = (moved(identity, pose).apply(places) - places) / step
        np.testing.assert_allclose(columns[k], difference, atol=1e-5)


def test_weights_satisfy_the_conditions_of_a_minimumwithin_bounds() -> None:
    rng = np.random.default_rng(1)
    root = rng.normal(size=(8, 8))
    matrix, right = root @ root.T + 0.1 * np.eye(8), 3.0 * rng.normal(size=8)
    x = within_bounds(matrix, right)
    slope = matrix @ x - right
    assert (x == 0.0).any()
    assert ((x > 0.0) & (x < 1.0)).any()
    np.testing.assert_allclose(slope[(x > 0.0) & (x < 1.0)], 0.0, atol=1e-3)
    assert (slope[x == 0.0] > -1e-3).all()
    assert (slope[x == 1.0] < 1e-3).all()


def test_hidden_skin_is_not_trusted(basis: HeadBasis) -> None:
    nose = basis.feature_points["9.3"]
    assert basis.trust[nose] == 1.0
    # The inside of the lips and the sockets of the eyes.
    assert (basis.trust == 0.0).mean() > 0.2
