"""Layers of small convolutional networks, on single images of shape (height, width, channels) in single precision.

They compute what TensorFlow Lite's reference kernels compute. "Same" padding is TensorFlow's: the output has
ceil(size / stride) pixels, and an odd pixel of padding is at the end.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]


def convolution(x: Floats, weights: Floats, bias: Floats, stride: int, same: bool) -> Floats:
    """Return the convolution of ``x``, (H, W, I), with ``weights`` of shape (O, k, l, I), plus ``bias``, (O,)."""
    n_out, rows, columns, n_in = weights.shape
    matrix = weights.reshape(n_out, -1).T
    if rows == columns == stride == 1:
        height, width = x.shape[:2]
        patches = x.reshape(-1, n_in)
    else:
        padded = _padded(x, (rows, columns), stride, 0.0) if same else x
        windows = np.lib.stride_tricks.sliding_window_view(padded, (rows, columns), (0, 1))[::stride, ::stride]
        height, width = windows.shape[:2]
        patches = windows.transpose(0, 1, 3, 4, 2).reshape(height * width, -1)
    result = patches @ matrix
    result += bias
    return result.reshape(height, width, n_out)


def depthwise(x: Floats, weights: Floats, bias: Floats, stride: int, same: bool) -> Floats:
    """Return the convolution of each channel of ``x``, (H, W, C), with its own ``weights``, (k, l, C), plus ``bias``.

    Rows are handled as vectors of W C numbers, which are long enough for NumPy to be fast.
    """
    rows, columns, channels = weights.shape
    padded = _padded(x, (rows, columns), stride, 0.0) if same else x
    height, width = (padded.shape[0] - rows) // stride + 1, (padded.shape[1] - columns) // stride + 1
    # Pixels that a weight of one row and column sees are neighbours in one of the images of every stride-th pixel.
    phases = {
        (u, v): np.ascontiguousarray(padded[u::stride, v::stride])
        for u in range(min(stride, rows))
        for v in range(min(stride, columns))
    }
    result = np.tile(bias, (height, width))
    product = np.empty_like(result)
    length = width * channels
    for u in range(rows):
        for v in range(columns):
            phase = phases[u % stride, v % stride]
            first, begin = u // stride, v // stride * channels
            lines = phase.reshape(len(phase), -1)[first : first + height, begin : begin + length]
            np.multiply(lines, np.tile(weights[u, v], width), out=product)
            result += product
    return result.reshape(height, width, channels)


def max_pool(x: Floats, size: tuple[int, int], stride: int, same: bool) -> Floats:
    """Return the maxima of ``x``, (H, W, C), over windows of ``size``, rows and columns."""
    padded = _padded(x, size, stride, -np.inf) if same else x
    height, width = (padded.shape[0] - size[0]) // stride + 1, (padded.shape[1] - size[1]) // stride + 1
    result: Floats | None = None
    for u in range(size[0]):
        for v in range(size[1]):
            part = padded[u : u + stride * height : stride, v : v + stride * width : stride][:height, :width]
            result = part.copy() if result is None else np.maximum(result, part, out=result)
    assert result is not None
    return result


def prelu(x: Floats, slopes: Floats) -> Floats:
    """Return ``x``, (H, W, C), with negative values multiplied by the ``slopes`` of their channels, (C,)."""
    negative = np.minimum(x, np.float32(0.0))
    negative *= slopes
    positive: Floats = np.maximum(x, np.float32(0.0))
    positive += negative
    return positive


def more_channels(x: Floats, count: int) -> Floats:
    """Return ``x``, (H, W, C), followed by ``count`` channels of zeros."""
    result = np.zeros((*x.shape[:2], x.shape[2] + count), dtype=np.float32)
    result[..., : x.shape[2]] = x
    return result


def _padded(x: Floats, size: tuple[int, int], stride: int, value: float) -> Floats:
    """Return ``x`` with TensorFlow's "same" padding for windows of ``size``."""
    wanted = [max((-(-n // stride) - 1) * stride + k - n, 0) for n, k in zip(x.shape[:2], size, strict=True)]
    if not any(wanted):
        return x
    (top, left), (height, width, channels) = (wanted[0] // 2, wanted[1] // 2), x.shape
    result = np.full((height + wanted[0], width + wanted[1], channels), value, dtype=np.float32)
    result[top : top + height, left : left + width] = x
    return result
