"""Changes of a photo applied to its pixels, a strip of rows at a time, so that large photos need little memory."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.progress import Progress

Array = NDArray[np.float64]
Image32 = NDArray[np.float32]
Indices = NDArray[np.int64]

# Difference of the offsets of neighbours at an edge, in pixels of the grid.
_JUMP = 3.0
# Offsets, in pixels of the grid, that change nothing.
_STILL = 1e-3
# Cells of a strip at most, and the pixels around it to which a cubic spline reaches (0.27^16 of its values are left).
_CELLS, _REACH = 2**18, 16


@dataclass(frozen=True, eq=False)
class PhotoChange:
    """How a photo changes, on the grid of its head.

    Attributes:
        offsets: From each pixel to the place of the photo whose colours it gets, in pixels of the grid, (h, w, 2).
        light: Logarithm of the factor on these colours, shape (h, w, 3).
        drawn: Share of the drawn colours, shape (h, w).
        colours: Those colours, 0 to 1, shape (h, w, 3).
    """

    offsets: Array
    light: Array
    drawn: Array
    colours: Array


@dataclass(frozen=True, eq=False)
class _Enlarging:
    """Linear enlargement of one axis: the neighbours of each new sample, the share of the second, and the nearest."""

    first: Indices
    second: Indices
    share: Image32
    nearest: Indices

    @classmethod
    def of(cls, old: int, new: int, start: int, end: int) -> "_Enlarging":
        """Return that of ``old`` samples to ``new``, for those from ``start`` to ``end``."""
        samples = np.arange(start, end)
        places = np.clip((samples + 0.5) * old / new - 0.5, 0.0, old - 1.0)
        first = np.floor(places).astype(np.int64)
        second = np.minimum(first + 1, old - 1)
        return cls(first, second, (places - first).astype(np.float32), samples * old // new)


def with_change(part: NDArray[np.uint8], change: PhotoChange, progress: Progress | None = None) -> NDArray[np.uint8]:
    """Return the ``part`` of a photo around the head, (h, w, 3), with ``change``.

    The difference from the photo is added to it, so that nothing is lost where nothing changes.

    Raises:
        CancelledError: If the user has cancelled the work.
    """
    progress = progress or Progress()
    height, width = part.shape[:2]
    cells = max(change.drawn.shape[0] // height, 1)
    edges = _edges(change.offsets)
    columns = _Enlarging.of(change.drawn.shape[1], width * cells, 0, width * cells)
    step = max(_CELLS // (width * cells * cells), 1)
    result = part.copy()
    for top in range(0, height, step):
        progress.at("Putting the face back", top / height)
        bottom = min(top + step, height)
        rows = _Enlarging.of(change.drawn.shape[0], height * cells, top * cells, bottom * cells)
        difference = _difference(part, change, edges, (rows, columns), (top, bottom), cells)
        if difference is not None:
            strip = part[top:bottom].astype(np.float32) / np.float32(255.0)
            result[top:bottom] = (255.0 * np.clip(strip + difference, 0.0, 1.0) + 0.5).astype(np.uint8)
    return result


def _difference(
    part: NDArray[np.uint8],
    change: PhotoChange,
    edges: NDArray[np.bool_],
    axes: tuple[_Enlarging, _Enlarging],
    strip: tuple[int, int],
    cells: int,
) -> Image32 | None:
    """Return what ``change`` adds to the colours of the rows of ``strip``, or None if nothing."""
    (height, width), (top, bottom) = part.shape[:2], strip
    offsets, light, drawn = (_enlarged(value, axes) for value in (change.offsets, change.light, change.drawn))
    if not (offsets.any() or light.any() or drawn.any()):
        return None
    colours = _enlarged(change.colours, axes)
    # Offsets are not mixed across edges, as of the jaw before the neck.
    edge = edges[axes[0].nearest][:, axes[1].nearest]
    offsets[edge] = change.offsets[axes[0].nearest][:, axes[1].nearest][edge]
    own = [(np.arange(start * cells, end * cells) + 0.5) / cells - 0.5 for start, end in (strip, (0, width))]
    # Offsets are counted in pixels of the grid; places are exact enough in double precision only.
    places = [
        np.clip(
            place + offsets[..., 1 - k].astype(np.float64) * (part.shape[k] / change.drawn.shape[k]),
            -0.5 * _REACH,
            part.shape[k] - 1 + 0.5 * _REACH,
        )
        for k, place in enumerate((own[0][:, None], own[1][None]))
    ]
    low = min(int(np.floor(places[0].min())), top) - _REACH
    high = max(int(np.ceil(places[0].max())), bottom) + _REACH + 1
    shifts = (low, -_REACH)
    moved = np.stack([place - shift for place, shift in zip(places, shifts, strict=True)])
    around = [np.clip(np.arange(low, high), 0, height - 1), np.clip(np.arange(-_REACH, width + _REACH), 0, width - 1)]
    unmoved = np.stack(np.meshgrid(*(o - s for o, s in zip(own, shifts, strict=True)), indexing="ij"))
    # Elsewhere nothing is added.
    chosen = (np.abs(offsets) > _STILL).any(axis=2) | (light != 0.0).any(axis=2) | (drawn > 0.0)
    moved, unmoved, light, colours = moved[:, chosen], unmoved[:, chosen], light[chosen], colours[chosen]
    share = drawn[chosen]
    result = np.empty((bottom - top, width, 3), dtype=np.float32)
    added = np.zeros(drawn.shape, dtype=np.float32)
    for channel in range(3):
        source = part[..., channel][around[0]][:, around[1]].astype(np.float32) / np.float32(255.0)
        smooth = ndimage.spline_filter(source, output=np.float32, mode="nearest")
        warped = _looked_up(smooth, moved)
        # Between pixels, the photo is what the spline has there.
        before = source[tuple(unmoved.astype(np.int64))] if cells == 1 else _looked_up(smooth, unmoved)
        added[chosen] = (1.0 - share) * warped * np.exp(light[:, channel]) + share * colours[:, channel] - before
        result[..., channel] = added.reshape(bottom - top, cells, width, cells).mean(axis=(1, 3))
    return result


def _looked_up(smooth: Image32, places: Array) -> Image32:
    """Return the values of a spline with the coefficients ``smooth`` at ``places``, (2, n), between 0 and 1, (n,)."""
    values = ndimage.map_coordinates(smooth, places, np.float32, order=3, mode="nearest", prefilter=False)
    result: Image32 = np.clip(values, 0.0, 1.0)
    return result


def _edges(offsets: Array) -> NDArray[np.bool_]:
    """Return where neighbours among ``offsets``, (h, w, 2), differ much, shape (h, w)."""
    jumps = ndimage.maximum_filter(offsets, (3, 3, 1)) - ndimage.minimum_filter(offsets, (3, 3, 1))
    result: NDArray[np.bool_] = jumps.max(axis=2) > _JUMP
    return result


def _enlarged(image: Array, axes: tuple[_Enlarging, _Enlarging]) -> Image32:
    """Return the part of ``image``, (h, w) or (h, w, k), that ``axes`` are for, linearly enlarged."""
    rows, columns = axes
    more = (None,) * (image.ndim - 2)
    share = rows.share[(slice(None), None, *more)]
    some = (1.0 - share) * image[rows.first].astype(np.float32) + share * image[rows.second].astype(np.float32)
    share = columns.share[(slice(None), *more)]
    result: Image32 = (1.0 - share) * some[:, columns.first] + share * some[:, columns.second]
    return result
