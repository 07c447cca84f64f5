"""Rasterise attributes of a mesh in texture space, and draw fine strokes into the images."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

Image32 = NDArray[np.float32]
Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


#: Pixels per centimetre at which a hair is one pixel wide.
HAIR_RESOLUTION = 50.0
#: Distance in pixels between the dots of a hair.
_STEP = 0.6
_MAX_STEPS = 600
#: Distance in space, in centimetres, below which texels that are farther apart in the texture are joined at a seam.
_SEAM_REACH, _SEAM_GAP = 0.12, 12


@dataclass(frozen=True)
class TexelMap:
    """Attributes of the surface at each texel.

    Attributes:
        covered: Mask of the texels that show the surface, shape (H, W); row 0 is v = 1.
        values: Attributes at the covered texels, shape (K, C), in the order of ``covered``.
        along: Change of column and row per centimetre along x, y and z in the tangent plane, shape (K, 2, 3).
    """

    covered: NDArray[np.bool_]
    values: Image32
    along: Image32

    @property
    def pixels_per_area(self) -> Image32:
        """Pixels per square centimetre of the surface at the covered texels, shape (K,)."""
        area: Image32 = np.linalg.norm(np.cross(self.along[:, 0], self.along[:, 1]), axis=1)
        return area

    @property
    def normals(self) -> Image32:
        """Unit normals of the surface at the covered texels, on one side of it, shape (K, 3)."""
        across = np.cross(self.along[:, 0], self.along[:, 1])
        normals: Image32 = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
        return normals

    def image(self, values: Image32) -> Image32:
        """Return values at covered texels, shape (K, C), as an image (H, W, C); others get the nearest one's value."""
        image = np.zeros((*self.covered.shape, values.shape[1]), dtype=np.float32)
        image[self.covered] = values
        nearest = ndimage.distance_transform_edt(~self.covered, return_distances=False, return_indices=True)
        filled: Image32 = image[tuple(nearest)]
        return filled


def map_texels(uv: Floats, corner_uvs: Ints, positions: Floats, attributes: Floats, size: int) -> TexelMap:
    """Interpolate attributes over triangles laid out in texture space.

    Args:
        uv: Texture coordinates, shape (U, 2).
        corner_uvs: Ids into ``uv`` per triangle, shape (T, 3).
        positions: Positions in centimetres of the triangles' corners, shape (T, 3, 3).
        attributes: Values at the triangles' corners, shape (T, 3, C).
        size: Width and height of the texture.
    """
    pixel = np.stack([uv[:, 0] * size - 0.5, (1.0 - uv[:, 1]) * size - 0.5], axis=1)[corner_uvs]
    which = np.full((size, size), -1, dtype=np.int32)
    weight = np.zeros((size, size, 2), dtype=np.float32)
    low = np.clip(np.ceil(pixel.min(axis=1) - 0.01).astype(int), 0, size)
    high = np.clip(np.floor(pixel.max(axis=1) + 0.01).astype(int) + 1, 0, size)
    edge1, edge2 = pixel[:, 1] - pixel[:, 0], pixel[:, 2] - pixel[:, 0]
    twice = edge1[:, 0] * edge2[:, 1] - edge1[:, 1] * edge2[:, 0]
    for t in np.flatnonzero((high > low).all(axis=1) & (np.abs(twice) > 1e-9)).tolist():
        columns, rows = slice(low[t, 0], high[t, 0]), slice(low[t, 1], high[t, 1])
        x = np.arange(columns.start, columns.stop) - pixel[t, 0, 0]
        y = (np.arange(rows.start, rows.stop) - pixel[t, 0, 1])[:, None]
        b = (x * edge2[t, 1] - y * edge2[t, 0]) / twice[t]
        c = (y * edge1[t, 0] - x * edge1[t, 1]) / twice[t]
        inside = (b >= -1e-6) & (c >= -1e-6) & (b + c <= 1 + 1e-6)
        which[rows, columns][inside] = t
        weight[rows, columns][inside] = np.stack([b[inside], c[inside]], axis=-1)
    covered = which >= 0
    t = which[covered]
    b, c = weight[covered].T
    shares = np.stack([1.0 - b - c, b, c], axis=1)
    values = np.einsum("kc,kcd->kd", shares, attributes[t].astype(np.float32))
    along = _pixels_per_centimetre(positions, pixel)[t].astype(np.float32)
    return TexelMap(covered, values.astype(np.float32), along)


def _pixels_per_centimetre(positions: Floats, pixel: Floats) -> Floats:
    """Return per triangle the derivative of the pixel with respect to position in its plane, shape (T, 2, 3)."""
    in_space = np.stack([positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0]], axis=-1)
    in_image = np.stack([pixel[:, 1] - pixel[:, 0], pixel[:, 2] - pixel[:, 0]], axis=-1)
    derivative: Floats = in_image @ np.linalg.pinv(in_space, rcond=1e-4)
    return derivative


def draw_strokes(
    texels: TexelMap,
    flow: Image32,
    starts: NDArray[np.intp],
    lengths: Image32,
    strengths: Image32,
    bend: Image32,
    allowed: NDArray[np.bool_],
    places: Image32 | None = None,
) -> Image32:
    """Draw hairs that follow a flow on the surface and taper off.

    Opacity is that of a hair one pixel wide at `HAIR_RESOLUTION`; it is lower for larger pixels, so that the hair has
    the same visible density everywhere.

    Args:
        texels: The surface.
        flow: Direction in space at covered texels, shape (K, 3).
        starts: Covered texels where the hairs are rooted, shape (n,).
        lengths: Their lengths in centimetres, shape (n,).
        strengths: Their opacity, shape (n,).
        bend: Sideways turn of each on the surface, as the tangent of the angle, shape (n,).
        allowed: Covered texels that hairs may enter, shape (K,).
        places: Positions of the covered texels in centimetres, shape (K, 3), with which hairs continue across seams of
            the texture; without them they end there.

    Returns:
        Optical thickness, shape (H, W): 1 - exp(-thickness) is the opacity.
    """
    height, width = texels.covered.shape
    velocity = np.zeros((height, width, 2), dtype=np.float32)
    velocity[texels.covered] = np.einsum("kij,kj->ki", texels.along, flow)
    # Bending is defined on the surface; the texture may be stretched.
    sideways = np.zeros((height, width, 2), dtype=np.float32)
    sideways[texels.covered] = np.einsum("kij,kj->ki", texels.along, np.cross(texels.normals, flow))
    enter = np.zeros((height, width), dtype=bool)
    enter[texels.covered] = allowed
    fineness = np.zeros((height, width), dtype=np.float32)
    fineness[texels.covered] = texels.pixels_per_area
    fineness /= HAIR_RESOLUTION * np.maximum(np.linalg.norm(velocity, axis=2), 1.0)
    rows, columns = np.nonzero(texels.covered)
    at = np.stack([columns[starts], rows[starts]], axis=1).astype(np.float32)
    travelled = np.zeros(len(starts), dtype=np.float32)
    thickness = np.zeros(height * width)
    seam = None if places is None else _Seam(texels.covered, places)
    before = np.stack([columns[starts], rows[starts]], axis=1)
    may_cross = np.full(len(starts), seam is not None)
    for _ in range(_MAX_STEPS):
        if seam is not None:
            seam.cross(at, before, may_cross)
        column, row = np.clip(np.rint(at).astype(int), 0, [width - 1, height - 1]).T
        speed = np.linalg.norm(velocity[row, column], axis=1)
        going = enter[row, column] & (travelled < lengths) & (speed > 1.0)
        if not going.any():
            break
        at, travelled, lengths, strengths, bend, speed, row, column, may_cross = (
            values[going] for values in (at, travelled, lengths, strengths, bend, speed, row, column, may_cross)
        )
        taper = 1.0 - 0.85 * (travelled / lengths) ** 1.5
        _splat(thickness, at, strengths * taper * _STEP * np.minimum(fineness[row, column], 1.5), width)
        before = np.stack([column, row], axis=1)
        direction = velocity[row, column] + bend[:, None] * sideways[row, column]
        at = at + _STEP * direction / np.linalg.norm(direction, axis=1, keepdims=True)
        travelled = travelled + _STEP / speed
    return thickness.reshape(height, width).astype(np.float32)


class _Seam:
    """Correspondence of the borders of texture charts across seams."""

    def __init__(self, covered: NDArray[np.bool_], places: Image32) -> None:
        self._covered = covered
        self._index = np.full(covered.shape, -1, dtype=np.int64)
        self._index[covered] = np.arange(len(places))
        self._places = places
        inner = ndimage.binary_erosion(covered, iterations=2, border_value=0)
        self._border = np.argwhere(covered & ~inner)[:, ::-1]
        self._tree = cKDTree(places[self._index[self._border[:, 1], self._border[:, 0]]])

    def cross(self, at: Image32, before: NDArray[np.int64], may_cross: NDArray[np.bool_]) -> None:
        """Move positions ``at`` (n, 2) that have left their chart to the other side of the seam, if there is one.

        Args:
            at: Columns and rows; changed in place.
            before: The previous covered texels, shape (n, 2).
            may_cross: Mask of those that have not crossed yet, shape (n,); changed in place, so that each hair crosses
                at most once.
        """
        height, width = self._covered.shape
        column, row = np.clip(np.rint(at).astype(int), 0, [width - 1, height - 1]).T
        out = np.flatnonzero(~self._covered[row, column] & may_cross)
        if not len(out):
            return
        from_place = self._places[self._index[before[out, 1], before[out, 0]]]
        distances, found = self._tree.query(from_place, k=24, distance_upper_bound=_SEAM_REACH)
        found = np.minimum(found, len(self._border) - 1)
        far = np.abs(self._border[found] - before[out][:, None]).max(axis=2) > _SEAM_GAP
        usable = far & np.isfinite(distances)
        rows = np.flatnonzero(usable.any(axis=1))
        at[out[rows]] = self._border[found[rows, usable[rows].argmax(axis=1)]]
        may_cross[out[rows]] = False


def softening(texels: TexelMap, reach: float) -> Image32:
    """Return the blur of fine detail in pixels (H, W) that avoids visible borders to larger texels.

    For texels smaller than others nearby, this is the standard deviation of the blur that gives detail the size of the
    others, decreasing with the distance from them.

    Args:
        texels: The surface.
        reach: Distance around larger texels in which detail is softened, in pixels.
    """
    size = np.zeros(texels.covered.shape, dtype=np.float32)
    size[texels.covered] = 1.0 / np.sqrt(np.maximum(texels.pixels_per_area, 1e-3))
    # Blurred at a quarter of the size, since the fields are smooth.
    small = size[::4, ::4]
    around = ndimage.gaussian_filter(ndimage.maximum_filter(small, round(reach / 4)), reach / 8)
    larger = np.clip(ndimage.zoom(around, 4, order=1)[: size.shape[0], : size.shape[1]], 1e-6, None)
    ratio = np.where(size > 0.0, larger / np.maximum(size, 1e-6), 1.0)
    sigma: Image32 = (0.8 * np.sqrt(np.maximum(ratio**2 - 1.0, 0.0))).astype(np.float32)
    return np.minimum(sigma, 3.0)


def softened(image: Image32, sigma: Image32) -> Image32:
    """Return ``image`` (H, W) blurred with a slowly varying deviation ``sigma`` (H, W) of 0 to 3 pixels."""
    levels = [image, *(ndimage.gaussian_filter(image, deviation) for deviation in (1.0, 2.0, 3.0))]
    result = np.zeros_like(image)
    for k, level in enumerate(levels):
        result += level * np.maximum(1.0 - np.abs(sigma - k), 0.0)
    return result


def _splat(image: Floats, at: Image32, amount: Image32, width: int) -> None:
    """Add ``amount`` to the flat ``image`` at positions ``at`` (n, 2) in columns and rows, shared by four pixels."""
    low = np.floor(at).astype(int)
    f = at - low
    base = low[:, 1] * width + low[:, 0]
    for dy in (0, 1):
        for dx in (0, 1):
            share = (f[:, 0] if dx else 1 - f[:, 0]) * (f[:, 1] if dy else 1 - f[:, 1])
            index = np.clip(base + dy * width + dx, 0, image.size - 1)
            np.add.at(image, index, share * amount)


class Noise:
    """Smooth random fields over space, the same in every run."""

    def __init__(self, seed: int) -> None:
        """Prepare the random lattice of ``seed``."""
        self._lattice = np.random.default_rng(seed).standard_normal((48, 48, 48)).astype(np.float32)

    def __call__(self, points: Image32, size: float, octaves: int = 1) -> Image32:
        """Return noise of mean 0 and deviation about 1 at ``points`` (..., 3), with largest features of ``size``."""
        shape = points.shape[:-1]
        points = points.reshape(-1, 3)
        total = np.zeros(len(points), dtype=np.float32)
        for octave in range(octaves):
            scaled = points.T / np.float32(size / 2**octave) + np.float32(11.3 * octave)
            total += ndimage.map_coordinates(self._lattice, scaled, order=1, mode="grid-wrap") * 0.6**octave
        deviation: Image32 = total * np.float32(1.7 / np.sqrt(sum(0.36**k for k in range(octaves))))
        return deviation.reshape(shape)


def smoothstep(low: float, high: float, x: Image32) -> Image32:
    """Return 0 below ``low``, 1 above ``high`` and a smooth cubic between; ``low`` may exceed ``high``."""
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    result: Image32 = (t * t * (3 - 2 * t)).astype(np.float32)
    return result
