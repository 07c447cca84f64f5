"""The statistics of heads: what `IdentityModel` learns, and the model that ships."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2, multivariate_normal

from faceposer.errors import FacePoserError
from faceposer.identity.model import IdentityModel
from faceposer.identity.model_file import load_identity_model, read_identity_file, save_identity_model
from faceposer.identity.registration import graph_laplacian
from faceposer.identity.segments import SEGMENT_NAMES, Segments
from faceposer.model.character_file import load_character
from faceposer.resources import asset_path
from tests.identity.meshes import skin

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def shipped() -> IdentityModel:
    return load_identity_model()


def heads_with(deviations: Array, n: int, n_vertices: int = 7) -> tuple[Array, Array]:
    """Return heads, (n, C, 3), with known modes, (K, 3 C), and the modes."""
    rng = np.random.default_rng(4)
    modes = np.linalg.qr(rng.normal(size=(3 * n_vertices, len(deviations))))[0].T
    heads = 5.0 + rng.normal(size=(n, len(deviations))) * deviations @ modes
    return heads.reshape(n, n_vertices, 3), modes


@pytest.mark.parametrize("n", [12, 4000], ids=["fewer heads than coordinates", "more"])
def test_known_modes_are_found(n: int) -> None:
    deviations = np.array([3.0, 1.0, 0.3])
    heads, modes = heads_with(deviations, n)
    model = IdentityModel().fit(heads)
    assert model.n_coefficients == 3
    assert np.allclose(model.modes @ model.modes.T, np.eye(3), atol=1e-9)
    # The span is exact; the modes themselves as good as the sample.
    assert np.allclose(modes - modes @ model.modes.T @ model.modes, 0.0, atol=1e-9)
    assert np.isclose(model.compactness()[-1], 1.0)
    rows = heads.reshape(n, -1)
    assert np.allclose(np.cov(rows.T), model.modes.T * model.standard_deviations**2 @ model.modes, atol=1e-9)
    if n > 1000:
        assert np.allclose(model.standard_deviations, deviations, rtol=0.05)
        assert np.allclose(model.mean, 5.0, atol=0.2)


def test_heads_are_projected_exactly_and_by_map() -> None:
    heads, _ = heads_with(np.array([3.0, 1.0, 0.3]), 50)
    model = IdentityModel().fit(heads)
    known = np.array([1.0, -2.0, 0.5])
    head = model.vertices(known)
    assert np.allclose(model.project(head, noise=0.0).coefficients, known)
    # Half of the vertices are enough without noise, and missing ones may be anything.
    weights = np.array([1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    partly = np.where(weights[:, None] > 0.0, head, np.nan)
    assert np.allclose(model.project(partly, weights, noise=0.0).coefficients, known)
    # The minimum of the energy: its gradient by finite differences is zero.
    noisy, sigma = head + np.random.default_rng(0).normal(size=head.shape), 0.7
    found = model.project(noisy, weights, sigma)

    def energy(b: Array) -> float:
        squares = np.square(noisy - model.vertices(b)).sum(axis=1)
        return float(weights @ squares / sigma**2 + b @ b)

    steps = 1e-4 * np.eye(3)
    slopes = [(energy(found.coefficients + s) - energy(found.coefficients - s)) / 2e-4 for s in steps]
    assert np.abs(slopes).max() < 1e-5
    left = np.square(noisy - model.vertices(found.coefficients)).sum(axis=1)
    assert np.isclose(found.residual, np.sqrt(weights @ left / weights.sum()))


def test_fewer_points_than_modes_need_noise() -> None:
    heads, _ = heads_with(np.array([3.0, 2.0, 1.0, 0.5]), 50)
    model = IdentityModel().fit(heads)
    one = np.eye(7)[0]
    with pytest.raises(ValueError, match="too few"):
        model.project(heads[0], one, noise=0.0)
    assert np.isfinite(model.project(heads[0], one, noise=0.1).coefficients).all()


def test_the_density_is_that_of_probabilistic_pca() -> None:
    heads, _ = heads_with(np.array([3.0, 2.0, 1.0, 0.5]), 60)
    model = IdentityModel(2).fit(heads + np.random.default_rng(5).normal(scale=0.2, size=heads.shape))
    d = len(model.mean)
    covariance = (model.modes.T * (model.standard_deviations**2 - model.noise**2)) @ model.modes
    known = multivariate_normal(model.mean, covariance + model.noise**2 * np.eye(d))
    assert np.allclose(model.score_samples(heads[:5]), known.logpdf(heads[:5].reshape(5, -1)))
    assert np.isclose(model.score(heads[:5]), known.logpdf(heads[:5].reshape(5, -1)).mean())
    with pytest.raises(ValueError, match="no variance"):
        IdentityModel().fit(heads_with(np.array([1.0]), 9)[0]).score_samples(heads)


def test_samples_follow_the_prior_and_repeat(shipped: IdentityModel) -> None:
    draws = shipped.sample(3, 500)
    assert np.array_equal(draws, shipped.sample(3, 500))
    assert abs(draws.mean()) < 0.02
    assert abs(draws.std() - 1.0) < 0.02
    given = draws[0]
    assert np.isclose(shipped.commonness(given), chi2(shipped.n_coefficients).sf(given @ given))
    assert shipped.commonness(np.zeros(shipped.n_coefficients)) == 1.0
    assert shipped.log_prior(given) == pytest.approx(-0.5 * given @ given)


def test_generalization_and_specificity_are_those_of_plain_sums() -> None:
    heads, _ = heads_with(np.array([3.0, 1.0, 0.3]), 80)
    model = IdentityModel().fit(heads[:60])
    found = model.generalization(heads[60:], [1, 3])
    along = (heads[60:].reshape(20, -1) - model.mean) @ model.modes[:1].T
    left = (heads[60:].reshape(20, -1) - model.mean - along @ model.modes[:1]).reshape(20, -1, 3)
    assert np.isclose(found[0], np.linalg.norm(left, axis=2).mean())
    assert found[1] < 1e-9 < found[0]
    # Heads drawn with no mode are the mean.
    nearest = np.linalg.norm(heads - model.mean_vertices, axis=2).mean(axis=1).min()
    assert np.isclose(model.specificity(heads, [0], 3)[0], nearest)


def test_bad_heads_are_refused() -> None:
    with pytest.raises(ValueError, match="two heads"):
        IdentityModel().fit(np.zeros((1, 9)))
    with pytest.raises(ValueError, match="finite"):
        IdentityModel().fit(np.full((3, 9), np.nan))
    model = IdentityModel().fit(heads_with(np.array([1.0]), 9)[0])
    with pytest.raises(ValueError, match="not of this model"):
        model.project(np.zeros((5, 3)))
    with pytest.raises(ValueError, match="no segments"):
        model.vertices(np.zeros((4, 1)))


def test_the_shipped_model_is_symmetric_and_level(shipped: IdentityModel) -> None:
    template = shipped.template
    assert template is not None
    mean = shipped.instance(np.zeros(0))
    assert mean.shape == (template.n_skin, 3)
    assert np.abs(mean - mean[template.mirror] * [-1.0, 1.0, 1.0]).max() < 1e-6
    # The end of the neck is in one plane on every head: no mode moves it up or down.
    edges = np.stack([template.control_quads, np.roll(template.control_quads, -1, axis=1)], axis=-1).reshape(-1, 2)
    _, number, counts = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    end = np.unique(edges[counts[number.reshape(-1)] == 1])
    assert np.abs(shipped.basis[:, end, 1]).max() < 1e-4
    assert np.diff(shipped.standard_deviations).max() < 0.0
    assert shipped.n_coefficients >= 60


def test_random_heads_of_the_shipped_model_are_sound(shipped: IdentityModel) -> None:
    template = shipped.template
    assert template is not None
    man = load_character("man")
    upper, lower = (man.feature_points[name] for name in ("2.2", "2.3"))
    lids = [(man.feature_points[a], man.feature_points[b]) for a, b in (("3.1", "3.3"), ("3.2", "3.4"))]

    def normals(vertices: Array) -> Array:
        corners = vertices[template.triangles]
        return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])

    plain = normals(shipped.instance(np.zeros(0)))
    for coefficients in shipped.sample(8, 12):
        head = shipped.instance(coefficients)
        assert 15.0 < np.ptp(head[:, 0]) < 23.0
        assert head[upper, 1] - head[lower, 1] < 0.25
        for up, down in lids:
            assert 0.3 < head[up, 1] - head[down, 1] < 1.8
        assert (np.einsum("td,td->t", normals(head), plain) < 0.0).mean() < 0.006


def test_unseen_identities_need_sixty_modes(shipped: IdentityModel) -> None:
    # The shipped modes hold 99.9 % of the variance of the scans' identities.
    heads = np.stack([shipped.instance(row) for row in shipped.sample(21, 12)])
    assert shipped.compactness()[-1] > 0.998
    errors = 10.0 * shipped.generalization(heads, [20, 60])
    assert errors[1] < 0.55 < errors[0]


def test_segments_are_a_smooth_partition_of_unity(shipped: IdentityModel) -> None:
    segments, template = shipped.segments, shipped.template
    assert segments is not None
    assert template is not None
    assert segments.names == SEGMENT_NAMES
    man = load_character("man")
    weights = template.skin(segments.weights.T)
    for name, point in (("eyes", "3.7"), ("nose", "9.3"), ("mouth", "8.1"), ("rest", "10.3"), ("rest", "2.13")):
        assert weights[man.feature_points[point], segments.names.index(name)] > 0.6, point
    flip = template.mirror[: template.n_control]
    assert np.abs(segments.weights - segments.weights[:, flip]).max() < 0.01


def test_equal_segments_give_the_head_and_others_no_seams(shipped: IdentityModel) -> None:
    segments, template = shipped.segments, shipped.template
    assert segments is not None
    assert template is not None
    rows = shipped.sample(9, 8)
    same = np.tile(rows[0], (4, 1))
    assert np.allclose(shipped.instance(same), shipped.instance(rows[0]), atol=1e-12)
    # Against the blend of the heads' own relief, the second differences of the surface show what blending adds.
    laplacian, weights = graph_laplacian(template.triangles, template.n_skin), template.skin(segments.weights.T)
    heads = np.stack([shipped.instance(row) for row in rows[:4]])
    relief = np.einsum("ns,snd->nd", weights, np.stack([laplacian @ head for head in heads]))
    seams = 10.0 * np.linalg.norm(laplacian @ shipped.instance(rows[:4]) - relief, axis=1)
    assert np.quantile(seams, 0.99) < 0.1
    assert seams.max() < 0.35
    free = segments.coefficients(rows[0], {"nose": rows[1]})
    nosy = shipped.instance(free)
    moved = np.linalg.norm(nosy - shipped.instance(rows[0]), axis=1)
    assert moved[weights[:, 1] < 1e-3].max() < 0.002
    assert moved.max() > 0.1


def test_segments_fit_better(shipped: IdentityModel) -> None:
    head = shipped.instance(shipped.sample(30)[0])
    whole = shipped.project(head, noise=0.02, n_modes=20).coefficients
    parts = shipped.project_segments(head, noise=0.02, n_modes=20)
    errors = [np.linalg.norm(shipped.instance(b) - head, axis=1).mean() for b in (whole, parts)]
    assert errors[1] < 0.92 * errors[0]


def test_the_control_mesh_carries_the_skin(shipped: IdentityModel) -> None:
    template = shipped.template
    assert template is not None
    man, _ = skin("man")
    again = template.skin(template.control(man))
    assert 10.0 * np.linalg.norm(again - man, axis=1).mean() < 0.02
    control = shipped.mean_vertices
    assert np.allclose(template.control(template.skin(control)), control)
    assert np.allclose(template.mirrored(template.mirrored(control)), control)


def test_a_model_is_written_and_read(shipped: IdentityModel, tmp_path: Path) -> None:
    path, extra = tmp_path / "model.npz", {"texture.mean": np.arange(3)}
    save_identity_model(path, shipped, extra, {"made": "by a test"})
    meta, members = read_identity_file(path)
    assert np.array_equal(members["texture.mean"], [0, 1, 2])
    assert meta["made"] == "by a test"
    again = load_identity_model(path)
    assert np.abs(again.basis - shipped.basis).max() < 1e-4
    assert np.allclose(again.mean, shipped.mean, atol=1e-5)
    assert again.credits == shipped.credits
    assert again.noise == shipped.noise
    assert again.segments is not None
    assert shipped.segments is not None
    assert np.abs(again.segments.weights - shipped.segments.weights).max() < 1e-4


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"shape.mean": np.zeros((5, 3), np.float32)}, "topology"),
        ({"shape.deviations": np.zeros(100, np.float32)}, "do not belong together"),
        ({"shape.modes": None}, "do not belong together"),
        ({"shape.steps": np.full(100, np.nan, np.float32)}, "do not belong together"),
        ({"shape.segments": np.ones((9, 4326), np.uint16)}, "do not belong together"),
        ({"shape.mean": np.array([{}], dtype=object)}, "pickled"),
        ({"meta": np.frombuffer(b'{"format": "other"}', np.uint8)}, "not a model of heads"),
        ({"meta": np.frombuffer(b'{"format": "faceposer.identity", "version": 9}', np.uint8)}, "version 9"),
        ({"meta": None}, "metadata"),
    ],
)
def test_damaged_files_are_refused(tmp_path: Path, change: dict[str, NDArray[np.generic] | None], reason: str) -> None:
    with np.load(asset_path("identity.npz"), allow_pickle=False) as data:
        members = {name: data[name] for name in data.files if name.startswith(("shape.", "meta"))}
    members = {name: array for name, array in (members | change).items() if array is not None}
    path = tmp_path / "broken.npz"
    np.savez(path, **members)
    with pytest.raises(FacePoserError, match=reason):
        load_identity_model(path)


def test_other_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "text.npz"
    path.write_text("no archive")
    with pytest.raises(FacePoserError, match="not a model file"):
        load_identity_model(path)
    with pytest.raises(FacePoserError, match="cannot be read"):
        load_identity_model(tmp_path / "missing.npz")


def test_weights_of_segments_must_sum_to_one() -> None:
    with pytest.raises(ValueError, match="sum to 1"):
        Segments(("a", "b"), np.full((2, 5), 0.6))
