"""Models learned from scans."""

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.alignment import rigid_alignment
from faceposer.identity.model_file import load_identity_model
from faceposer.identity.scans import detail, learning
from faceposer.identity.scans.basis import HeadBasis
from faceposer.identity.scans.head_from_scans import Scan
from faceposer.identity.scans.learning import Work, aligned_heads, learn_model, registered
from faceposer.identity.scans.smooth_modes import smooth_modes
from tests.identity.meshes import ELSEWHERE
from tests.identity.scans.conftest import SmilingScan


def test_a_scan_is_registered_by_smooth_deformations(
    basis: HeadBasis, smiling: SmilingScan, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(learning, "_SMOOTH_STAGES", tuple(replace(s, rounds=3) for s in learning._SMOOTH_STAGES))
    monkeypatch.setattr(detail, "SETTINGS", replace(detail.SETTINGS, stiffness=(30.0,), rounds=1))
    scan = Scan("me", smiling.mesh, smiling.landmarks)
    chosen = np.flatnonzero(basis.trust[: basis.n_control] > 0.0)
    head = registered(Work(scan, replace(basis, modes=smooth_modes(basis.mean, chosen)[:50]), smooth=True))
    face = basis.trust > 0.9
    errors = []
    for each in (basis.mean, head):
        moved = rigid_alignment(each[face], smiling.neutral[face], scale=True).apply(each[face])
        errors.append(10.0 * np.linalg.norm(moved - smiling.neutral[face], axis=1).mean())
    # The smile stays in it, and smooth deformations do not place the vertices exactly.
    assert errors[1] < 0.8 * errors[0]


def test_the_model_spans_the_heads_it_was_learned_from(basis: HeadBasis, smiling: SmilingScan) -> None:
    start = load_identity_model()
    truth = [start.instance(row) for row in start.sample(8, 4)]
    truth[1] = ELSEWHERE.apply(truth[1])
    scans = [Scan(f"scan {k}", smiling.mesh, smiling.landmarks) for k in range(4)]

    def known(function: Callable[[Work], np.ndarray], works: Iterable[Work]) -> Iterable[np.ndarray]:
        assert function is registered
        assert len(list(works)) == 4
        return truth

    learned = learn_model(scans, start, 1, mapper=known)
    assert learned.model.n_coefficients == 3
    for head in learned.heads:
        assert 10.0 * learned.model.project(head, noise=0.0).residual < 0.2
    sizes = [np.ptp(head, axis=0).max() for head in learned.heads]
    assert max(sizes) / min(sizes) < 1.2


def test_alignment_removes_motion_and_size() -> None:
    rng = np.random.default_rng(0)
    head = rng.normal(size=(50, 3))
    moved = aligned_heads(np.stack([head, ELSEWHERE.apply(head)]), np.ones(50))
    np.testing.assert_allclose(moved[0], moved[1], atol=1e-9)


def test_too_few_scans_are_refused(smiling: SmilingScan) -> None:
    with pytest.raises(FacePoserError, match="at least 3 scans; there are 1"):
        learn_model([Scan("me", smiling.mesh, smiling.landmarks)], load_identity_model())
