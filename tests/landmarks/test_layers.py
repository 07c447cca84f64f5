"""The layers agree with plain loops over their definitions."""

import numpy as np
import pytest

from faceposer.landmarks import layers


def by_loops(x: np.ndarray, size: tuple[int, int], stride: int, same: bool, value: float) -> np.ndarray:
    """Return the windows of ``x``, (rows, columns, k, l, C), with TensorFlow's padding."""
    if same:
        pads = [max((-(-n // stride) - 1) * stride + k - n, 0) for n, k in zip(x.shape[:2], size, strict=True)]
        x = np.pad(
            x, [(pads[0] // 2, -(-pads[0] // 2)), (pads[1] // 2, -(-pads[1] // 2)), (0, 0)], constant_values=value
        )
    height, width = ((n - k) // stride + 1 for n, k in zip(x.shape[:2], size, strict=True))
    return np.stack(
        [
            [x[stride * i : stride * i + size[0], stride * j : stride * j + size[1]] for j in range(width)]
            for i in range(height)
        ]
    )


@pytest.mark.parametrize("same", [True, False])
@pytest.mark.parametrize(
    ("stride", "size"), [(1, (1, 1)), (1, (3, 3)), (2, (3, 3)), (2, (2, 2)), (2, (5, 5)), (3, (3, 2))]
)
@pytest.mark.parametrize("shape", [(8, 8, 3), (9, 7, 4)])
def test_windows(shape: tuple[int, int, int], stride: int, size: tuple[int, int], same: bool) -> None:
    rng = np.random.default_rng(0)
    x = rng.standard_normal(shape).astype(np.float32)
    weights = rng.standard_normal((5, *size, shape[2])).astype(np.float32)
    bias = rng.standard_normal(5).astype(np.float32)
    windows = by_loops(x, size, stride, same, 0.0)
    expected = np.einsum("ijklc,oklc->ijo", windows, weights) + bias
    np.testing.assert_allclose(layers.convolution(x, weights, bias, stride, same), expected, atol=1e-4)
    own, own_bias = weights[0], rng.standard_normal(shape[2]).astype(np.float32)
    expected = np.einsum("ijklc,klc->ijc", windows, own) + own_bias
    np.testing.assert_allclose(layers.depthwise(x, own, own_bias, stride, same), expected, atol=1e-4)
    windows = by_loops(x, size, stride, same, -np.inf)
    np.testing.assert_array_equal(layers.max_pool(x, size, stride, same), windows.max(axis=(2, 3)))


def test_prelu_and_channels() -> None:
    x = np.array([[[-2.0, 3.0, -1.0]]], dtype=np.float32)
    np.testing.assert_array_equal(layers.prelu(x, np.array([0.5, 0.5, 2.0], dtype=np.float32)), [[[-1.0, 3.0, -2.0]]])
    np.testing.assert_array_equal(layers.more_channels(x, 2), [[[-2.0, 3.0, -1.0, 0.0, 0.0]]])
    assert x[0, 0, 0] == -2.0
