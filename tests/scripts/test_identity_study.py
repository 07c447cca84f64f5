"""Rows of the study of the morphable model, on few heads."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from faceposer.geometry.mesh import TriangleMesh
from faceposer.identity.attributes import load_attributes
from faceposer.identity.model_file import load_identity_model
from faceposer.identity.scans.head_from_scans import shipped_basis
from faceposer.identity.template import head_template
from faceposer.model.character_file import load_character
from scripts.identity_study import model_rows
from scripts.identity_study.eos_fit import EosFit
from scripts.identity_study.rows import row
from scripts.identity_study.sampling import vertex_errors, with_hair
from scripts.study_heads import MEASURED


def test_a_row_has_the_means_over_heads() -> None:
    made = row("t", "m", 3, [np.array([1.0, 2.0, 6.0]), np.array([2.0, 2.0, 2.0])], 0.123, extra=1)
    assert (made["n"], made["error_mm_median"], made["error_mm_mean"]) == (2, 2.0, 2.5)
    assert (made["seconds"], made["extra"]) == (0.12, 1)


def test_heads_of_the_model_are_reconstructed(monkeypatch: pytest.MonkeyPatch) -> None:
    model = load_identity_model()
    heads = np.stack([model.vertices(b) for b in model.sample(3, 2)])
    learning = SimpleNamespace(template=head_template(), heads=lambda *_, **__: heads)
    monkeypatch.setattr(model_rows, "_COUNTS", (20, 100))
    rows = list(model_rows.reconstruction_rows(learning, 2))  # type: ignore[arg-type]
    assert [(made["method"], made["modes"]) for made in rows] == [
        ("mean", 0),
        ("modes", 20),
        ("modes", 100),
        ("segments", 20),
        ("segments", 100),
    ]
    mean, few, all_modes, few_segments, all_segments = (made["error_mm_mean"] for made in rows)
    assert mean > few > few_segments
    assert few_segments > all_segments
    assert all_modes < 0.1
    expected = 10.0 * np.linalg.norm(head_template().skin(heads[0] - model.mean_vertices), axis=1).mean()
    other = 10.0 * np.linalg.norm(head_template().skin(heads[1] - model.mean_vertices), axis=1).mean()
    assert mean == pytest.approx((expected + other) / 2.0, abs=1e-3)


def test_what_is_to_stay() -> None:
    attributes = load_attributes()
    assert set(model_rows._to_stay(attributes, "age")) == {"gender", "weight", "african", "asian", "caucasian"}
    assert set(model_rows._to_stay(attributes, "asian")) == {"gender", "age", "weight"}
    assert set(model_rows._to_stay(attributes, "nose-hump")) == set(attributes.names) - {"nose-hump"}
    assert set(model_rows._to_stay(attributes, "age", held=True)) == set(attributes.names) - {"age"}


def test_the_worst_of_random_heads_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def study(skin: np.ndarray, draws: int, seed: int) -> dict[str, object]:
        assert skin.shape == (head_template().n_skin, 3)
        depths = dict.fromkeys(MEASURED, 0.01 * (seed + 1))
        return {
            "blink_gap_mm": 0.1 * seed,
            "poses": 5,
            "deepest_mm": depths,
            "over": dict.fromkeys(MEASURED, seed),
        }

    monkeypatch.setattr(model_rows, "study", study)
    (made,) = model_rows.head_rows(3)
    assert (made["n"], made["poses"], made["blink_gap_mm_max"]) == (3, 15, 0.2)
    assert made["lid_lid_mm_max"] == 0.03
    assert made["poses_over"]["lips_teeth"] == 3


def test_hair_covers_the_scalp_alone() -> None:
    quads = head_template().quads
    mesh = TriangleMesh(head_template().rest, quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3))
    scalp = load_character("man").regions["scalp"]
    covered = with_hair(mesh, mesh.vertices[scalp], 3)
    raised = np.linalg.norm(covered.vertices - mesh.vertices, axis=1)
    assert 1.7 < raised[scalp].mean() < 2.3
    assert raised[scalp].std() > 0.1
    nose = load_character("man").feature_points["9.3"]
    assert raised[nose] == 0.0
    assert (raised == 0.0).mean() > 0.5


def test_eos_fits_landmarks() -> None:
    pytest.importorskip("eos", reason="eos is not installed: faceposer[bench]")
    basis = shipped_basis()
    # A small model keeps it quick; its landmarks are exact.
    basis = replace(basis, modes=basis.modes[:10])
    truth = basis.head(np.array([1.0, -1.0, 0.5, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    known = np.flatnonzero(basis.on_skin)
    rows, shares = basis.landmarks.corners(basis.triangles)[known], basis.landmarks.barycentric[known]
    places = np.einsum("mcd,mc->md", truth[rows], shares)
    data = SimpleNamespace(places=places, rows=rows, shares=shares, spreads=np.zeros(len(known)))
    head = EosFit(basis).head(SimpleNamespace(data=data), sigma=0.02)  # type: ignore[arg-type]
    face = basis.trust >= 0.9
    assert vertex_errors(head, truth, face).mean() < 0.4 * vertex_errors(basis.mean, truth, face).mean()
