"""The basis of the shipped model, and scans of its heads."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from faceposer.geometry.mesh import TriangleMesh
from faceposer.identity.character import character_of
from faceposer.identity.model_file import load_identity_model
from faceposer.identity.scans.basis import HeadBasis
from faceposer.identity.scans.head_from_scans import shipped_basis
from faceposer.identity.scans.scan import ScanLandmarks
from faceposer.landmarks.drawing import PaintedMesh
from tests.identity.meshes import ELSEWHERE, remeshed

Array = NDArray[np.float64]

#: Standard deviation of landmarks along each axis, in centimetres.
NOISE = 0.12


@pytest.fixture(scope="session")
def basis() -> HeadBasis:
    """Return the basis of the shipped model."""
    return shipped_basis()


@dataclass(frozen=True, eq=False)
class SmilingScan:
    """A scan of a smiling head in another unit and pose.

    Attributes:
        neutral: The head without expression, in centimetres.
        mesh: The scan; its vertices are none of the head's, and a cheek is missing.
        landmarks: Its landmarks, with errors.
    """

    neutral: Array
    mesh: PaintedMesh
    landmarks: ScanLandmarks


@pytest.fixture(scope="session")
def smiling(basis: HeadBasis) -> SmilingScan:
    """Return the scan of a sampled head that smiles with closed eyes."""
    model = load_identity_model()
    character = character_of(model.instance(model.sample(3)[0]), name="sampled", title="Sampled")
    n = len(basis.mean)
    neutral = character.vertices[:n].astype(np.float64)
    weights = {"mouthSmileLeft": 0.7, "mouthSmileRight": 0.7, "eyeBlinkLeft": 1.0, "eyeBlinkRight": 1.0}
    rows = [character.shape_names.index(name) for name in weights]
    posed = neutral + np.tensordot(list(weights.values()), character.shapes[rows, :n].astype(np.float64), 1)
    mesh = remeshed(posed, character.polygons[slice(*character.parts[0].polygons)])
    apart = np.linalg.norm(np.asarray(mesh.vertices)[mesh.triangles].mean(axis=1) - posed[_CHEEK], axis=1)
    holed = TriangleMesh(ELSEWHERE.apply(mesh.vertices), mesh.triangles[apart > 1.5])
    places = np.einsum("mcd,mc->md", posed[basis.landmarks.corners(basis.triangles)], basis.landmarks.barycentric)
    places += np.random.default_rng(0).normal(scale=NOISE, size=places.shape)
    landmarks = ScanLandmarks(ELSEWHERE.apply(places), np.zeros(len(places)), {})
    return SmilingScan(neutral, PaintedMesh(np.asarray(holed.vertices), holed.triangles), landmarks)


#: A vertex of the left cheek.
_CHEEK = 5000
