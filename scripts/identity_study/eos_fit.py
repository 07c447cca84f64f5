"""A rival: the linear fit of a morphable model by eos (Huber et al., VISAPP 2016) to the landmarks of a scan.

eos fits to landmarks in pictures and has no fit to surfaces. It gets the modes of our model, and the landmarks as seen
from the front. As in its own fit to photos, an affine camera and the shape are estimated in turns.
"""

import numpy as np
from numpy.typing import NDArray

from faceposer.identity.scans.basis import HeadBasis
from faceposer.identity.scans.scan import PlacedScan

Array = NDArray[np.float64]

# Standard deviation of landmarks in centimetres, the best of several on other identities, and number of turns.
_SIGMA, _TURNS = 0.4, 5
# Largest spread of a landmark over the views, in centimetres: eos is not robust to wrong ones.
_SURE = 0.25


def has_eos() -> bool:
    """Return True if eos is installed."""
    try:
        import eos  # noqa: F401
    except ImportError:
        return False
    return True


class LinearEos:
    """Fits by eos of a linear model to points in a picture."""

    def __init__(self, mean: Array, modes: Array, triangles: NDArray[np.integer]) -> None:
        """Prepare the model of eos with a mean, (N, 3), and modes of unit deviation, (K, N, 3)."""
        import eos

        self.mean = mean
        flat = modes.reshape(len(modes), -1)
        self._n, deviations = len(modes), np.linalg.norm(flat, axis=1)
        self._fit = eos.fitting.fit_shape_to_landmarks_linear
        self._model = eos.morphablemodel.PcaModel(
            mean.ravel().astype(np.float32),
            np.asfortranarray((flat / deviations[:, None]).T, dtype=np.float32),
            np.square(deviations).astype(np.float32),
            triangles.tolist(),
        )
        self._modes = modes

    def coefficients(self, vertices: NDArray[np.integer], seen: Array, sigma: float) -> Array:
        """Return the coefficients, (K,), most likely by ``vertices``, (m,), that are ``seen``, (m, 2).

        ``sigma`` is the standard deviation of what is seen, in the unit of the model if both are of one size.
        """
        seen, points = seen.astype(np.float32), self.mean[vertices]
        modes = self._modes[:, vertices]
        found = np.zeros(self._n)
        for _ in range(_TURNS):
            places = points + np.tensordot(found, modes, 1)
            rows = np.linalg.lstsq(np.column_stack([places, np.ones(len(vertices))]), seen, rcond=None)[0].T
            found = np.asarray(
                self._fit(
                    self._model,
                    np.concatenate([rows, [[0.0, 0.0, 0.0, 1.0]]]).astype(np.float32),
                    list(seen),
                    vertices.tolist(),
                    num_coefficients_to_fit=self._n,
                    detector_standard_deviation=sigma,
                    model_standard_deviation=0.0,
                    **{"lambda": 1.0},
                ),
                dtype=np.float64,
            )
        return found


class EosFit:
    """Fits by eos with the modes of a basis."""

    def __init__(self, basis: HeadBasis) -> None:
        """Prepare the model of eos."""
        self._basis = basis
        self._eos = LinearEos(basis.mean, basis.modes, basis.triangles)

    def head(self, placed: PlacedScan, sigma: float = _SIGMA) -> Array:
        """Return the head, (N, 3), most likely by the landmarks of a scan in the model's frame."""
        data, mean = placed.data, self._basis.mean
        sure = data.spreads < _SURE
        triangles, shares = data.rows[sure], data.shares[sure]
        # eos has landmarks at vertices: each is moved from its place in a triangle to the nearest corner.
        vertices = np.take_along_axis(triangles, shares.argmax(axis=1)[:, None], axis=1)[:, 0]
        shift = mean[vertices] - np.einsum("mcd,mc->md", mean[triangles], shares)
        return self._basis.head(self._eos.coefficients(vertices, (data.places[sure] + shift)[:, :2], sigma))
