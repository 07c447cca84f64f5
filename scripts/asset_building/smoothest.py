"""Smoothest functions on the skin's control mesh that interpolate given values."""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from scripts.asset_building.head import Skin
from scripts.asset_building.piece import Floats


def smoothest(skin: Skin, control: Floats, given: Floats, target: Floats, nearness: float) -> Floats:
    """Return the values on the mesh with the least-squares minimum of the Laplacian.

    They minimise |L f|² + nearness · |f - target|², L the Laplacian with weights of one over the edges' lengths, under
    the given values (Botsch and Kobbelt, "An intuitive framework for real-time freeform modeling", 2004).

    Args:
        skin: The mesh.
        control: Its control vertices in centimetres, shape (C, 3).
        given: Fixed values, NaN for free vertices, shape (C, k); a row is either fixed or free.
        target: Values that the free vertices are pulled to, shape (C, k).
        nearness: Weight of this pull.

    Returns:
        The values, shape (C, k).
    """
    n = len(control)
    a, b = np.stack([skin.quads, np.roll(skin.quads, -1, axis=1)], axis=-1).reshape(-1, 2).T
    weight = 1.0 / np.linalg.norm(control[a] - control[b], axis=1)
    links = sparse.csr_array((weight, (a, b)), shape=(n, n))
    links = links + links.T
    around = np.asarray(links.sum(axis=1)).ravel()
    laplacian = sparse.csr_array(sparse.eye_array(n) - sparse.diags_array(1.0 / around) @ links)
    system = sparse.csr_array(laplacian.T @ laplacian + nearness * sparse.eye_array(n))
    known = ~np.isnan(given[:, 0])
    result = np.where(known[:, None], given, 0.0)
    right = nearness * target[~known] - system[~known][:, known] @ result[known]
    result[~known] = spsolve(system[~known][:, ~known].tocsc(), right).reshape(-1, given.shape[1])
    return result
