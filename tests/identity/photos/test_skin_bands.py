"""The blend of skin seen with that of the model."""

import numpy as np
import pytest

from faceposer.identity.photos.skin_bands import blended_difference

_SIDE = 256


@pytest.fixture(scope="module")
def trust() -> np.ndarray:
    """Skin is seen in a disc."""
    rows, columns = np.mgrid[:_SIDE, :_SIDE]
    distance = np.hypot(rows - 128.0, columns - 128.0)
    return np.clip((90.0 - distance) / 10.0, 0.0, 1.0).astype(np.float32)


def _blended(difference: np.ndarray, trust: np.ndarray, free: float = 0.0, limited: bool = True) -> np.ndarray:
    ones = np.ones_like(trust)
    return blended_difference(difference.astype(np.float32), trust, ones, np.float32(free) * ones, limited)


def test_a_tone_goes_on_to_all_skin(trust: np.ndarray) -> None:
    tone = np.array([0.2, -0.1, -0.3])
    seen = np.where(trust[..., None] > 0.0, tone, 5.0)
    assert _blended(seen, trust) == pytest.approx(np.broadcast_to(tone, seen.shape), abs=1e-5)
    assert not _blended(seen, np.zeros_like(trust)).any()


def test_lines_are_kept_where_they_are_seen_well_and_end_before_the_border(trust: np.ndarray) -> None:
    seen = np.zeros((_SIDE, _SIDE, 3))
    seen[128, :] = -0.2
    found = _blended(seen, trust).mean(axis=2)
    contrast = found[128] - found[120]
    assert contrast[118:138].mean() == pytest.approx(-0.2, abs=0.05)
    assert np.abs(contrast[:42]).max() < 0.03
    assert np.abs(np.diff(contrast)).max() < 0.02


def test_blotches_of_colour_and_light_spots_are_reduced(trust: np.ndarray) -> None:
    rows, columns = np.mgrid[:_SIDE, :_SIDE]
    spot = np.exp(-0.5 * ((rows - 128.0) ** 2 + (columns - 128.0) ** 2) / 12.0**2)
    yellow, light = (_blended(spot[..., None] * np.array(c), trust) for c in ((0.1, 0.1, -0.2), (0.3, 0.3, 0.3)))
    assert np.ptp(yellow[128, 128]) < 0.5 * 0.3
    assert light[128, 128].mean() < 0.6 * 0.3
    # Brows and what a painter painted are no blotches.
    dark = spot[..., None] * np.array([-0.5, -0.55, -0.6])
    assert _blended(dark, trust, free=1.0)[128, 128].mean() < 1.4 * _blended(dark, trust)[128, 128].mean()
    assert _blended(dark, trust, limited=False)[128, 128] == pytest.approx(dark[128, 128], abs=0.02)


def test_gaps_are_bridged_without_what_lies_in_them(trust: np.ndarray) -> None:
    seen = np.broadcast_to(0.06 * np.linspace(-1.0, 1.0, _SIDE)[None, :, None], (_SIDE, _SIDE, 3)).copy()
    whole = _blended(seen, trust)
    gap = trust.copy()
    gap[:, 120:134] = 0.0
    seen[:, 120:134] = -3.0
    assert np.abs(_blended(seen, gap) - whole)[100:156, 100:156].max() < 0.02
