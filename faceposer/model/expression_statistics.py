"""Statistics of rig weights over natural expressions, for ARKit's 52 shapes or others, independent of any one face."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.atomic import atomic_file
from faceposer.files.reading import open_file
from faceposer.files.writing import check_finite
from faceposer.model.coupling import independent
from faceposer.model.errors import InconsistentError
from faceposer.resources import asset_path

Array = NDArray[np.float64]

_ARRAYS = ("weights", "means", "covariances", "mean", "covariance")
_UNIT_WITHIN = 1e-5
_FEWEST_EXAMPLES = 12
_MAX_BYTES = 64 * 2**20


@dataclass(frozen=True, eq=False)
class ExpressionStatistics:
    """A mixture of Gaussians over the weights of a rig, with the moments of its training examples.

    It gives any face with shapes of these names a prior, without a capture of that face.

    Attributes:
        shape_names: Names of the S weights.
        weights: Mixing proportions, shape (K,).
        means: Shape (K, S).
        covariances: Shape (K, S, S).
        mean: Mean of the examples, shape (S,).
        covariance: Covariance of the examples, shape (S, S), the input of the principal component analysis.
        credits: Source of the examples and their licence.
        regions: Region of the face of each weight; if empty, all belong to one region.
        coupling: Correlation matrix that damps covariances between regions, shape (S, S)
            (``faceposer.model.coupling``); if None, regions are independent.
        examples: A selection of the examples, shape (n, S), or None if none were kept.

    Raises:
        ValueError: If the arrays are inconsistent.
    """

    shape_names: tuple[str, ...]
    weights: Array
    means: Array
    covariances: Array
    mean: Array
    covariance: Array
    credits: str
    regions: tuple[str, ...] = ()
    coupling: Array | None = None
    examples: Array | None = None

    def __post_init__(self) -> None:
        if not self.regions:
            object.__setattr__(self, "regions", ("face",) * len(self.shape_names))
        if len(self.regions) != len(self.shape_names):
            raise InconsistentError(f"regions must name {len(self.shape_names)} regions, not {len(self.regions)}")
        if self.coupling is None:
            object.__setattr__(self, "coupling", independent(self.regions))
        n_components, n_shapes = len(self.weights), len(self.shape_names)
        shapes = {
            "weights": (n_components,),
            "means": (n_components, n_shapes),
            "covariances": (n_components, n_shapes, n_shapes),
            "mean": (n_shapes,),
            "covariance": (n_shapes, n_shapes),
            "coupling": (n_shapes, n_shapes),
        }
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value.shape != shape or not np.isfinite(value).all():
                raise InconsistentError(f"{name} must be finite and of shape {shape}, not {value.shape}")
        _check_correlation(self.factors)
        kept = self.examples
        if kept is not None and (kept.ndim != 2 or kept.shape[1] != n_shapes or not np.isfinite(kept).all()):
            raise InconsistentError(f"examples must be finite and of {n_shapes} columns, not of shape {kept.shape}")
        if kept is not None and len(kept) < _FEWEST_EXAMPLES:
            raise InconsistentError(f"examples must be at least {_FEWEST_EXAMPLES}, not {len(kept)}")
        if n_components == 0 or (self.weights <= 0).any():
            raise InconsistentError("weights must be positive, and at least one")

    @property
    def factors(self) -> Array:
        """The coupling as an array, shape (S, S), never None."""
        assert self.coupling is not None
        return self.coupling

    def as_members(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Return the values to store as JSON, and the arrays, for a character file.

        The arrays are in single precision, the examples in half precision.
        """
        texts: dict[str, Any] = {}
        arrays: dict[str, NDArray[Any]] = {}
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                arrays[field.name] = value.astype(np.float16 if field.name == "examples" else np.float32)
            elif value is not None:
                texts[field.name] = list(value) if isinstance(value, tuple) else value
        return texts, arrays

    @classmethod
    def of_members(cls, texts: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> Self:
        """Return the statistics from the members that ``as_members`` returned.

        Raises:
            TypeError: If a member is missing.
            ValueError: If the members are inconsistent.
        """
        known: dict[str, Any] = {
            name: tuple(map(str, value)) if isinstance(value, list) else str(value) for name, value in texts.items()
        }
        known |= {name: array.astype(np.float64) for name, array in arrays.items()}
        return cls(**known)

    def save(self, path: Path) -> None:
        """Write the statistics to ``path``, in single precision, the examples in half precision.

        Raises:
            FacePoserError: If a number is not finite in this precision, or the file cannot be written.
        """
        arrays: dict[str, Any] = {name: getattr(self, name).astype(np.float32) for name in (*_ARRAYS, "coupling")}
        if self.examples is not None:
            with np.errstate(over="ignore"):
                arrays["examples"] = self.examples.astype(np.float16)
        check_finite(path, "file of statistics", *arrays.values())
        with atomic_file(path, "file of statistics") as temporary, temporary.open("wb") as file:
            np.savez_compressed(
                file,
                shape_names=np.array(self.shape_names),
                credits=np.array(self.credits),
                regions=np.array(self.regions),
                **arrays,
            )


def _check_correlation(matrix: Array) -> None:
    """Raise a ValueError if the coupling ``matrix``, shape (S, S), is not a correlation matrix."""
    symmetric = np.allclose(matrix, matrix.T, atol=_UNIT_WITHIN)
    unit = np.allclose(np.diag(matrix), 1.0, atol=_UNIT_WITHIN)
    if not (symmetric and unit and np.linalg.eigvalsh(matrix)[0] > -1e-3):
        raise InconsistentError(
            "coupling must be a correlation matrix: symmetric, positive semidefinite, unit diagonal"
        )


def load_expression_statistics(path: Path | None = None) -> ExpressionStatistics:
    """Return the statistics in ``path``, or the shipped ones if None.

    Raises:
        FacePoserError: If the file cannot be read or does not contain expression statistics.
    """
    path = path or asset_path("expressions.npz")
    try:
        with open_file(path, _MAX_BYTES) as file, np.load(file, allow_pickle=False) as data:
            arrays = {name: data[name].astype(np.float64) for name in _ARRAYS}
            names = tuple(str(name) for name in data["shape_names"])
            arrays |= {name: data[name].astype(np.float64) for name in ("coupling", "examples") if name in data}
            regions = tuple(str(region) for region in data["regions"]) if "regions" in data else ()
            return ExpressionStatistics(names, credits=str(data["credits"]), regions=regions, **arrays)
    except OSError as error:
        reason = error.strerror or "it is damaged"
        raise FacePoserError(
            f"The expression statistics '{path}' cannot be read: {reason}; train them or install Face Poser again."
        ) from error
    except Exception as error:  # a damaged archive raises zipfile.BadZipFile, zlib.error, tokenize.TokenError, ...
        raise FacePoserError(f"The expression statistics '{path}' are damaged; install Face Poser again.") from error
