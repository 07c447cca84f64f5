"""The file of a morphable model, a NumPy archive without pickled objects (docs/identity.md).

Modes are stored as offsets per standard deviation, each in whole numbers of its own step: 16 bits keep a micrometre.
Members of other parts of the model, such as ``texture.mean``, are kept as they are.
"""

import os
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.arrays import DamagedError, TooLargeError, read_arrays
from faceposer.files.atomic import atomic_file
from faceposer.files.json_documents import parse_json
from faceposer.files.writing import check_finite, json_text
from faceposer.identity.model import IdentityModel
from faceposer.identity.segments import Segments
from faceposer.identity.template import head_template
from faceposer.resources import asset_path

FORMAT, VERSION = "faceposer.identity", 1
_MAX_BYTES, _MAX_MEMBERS = 256 << 20, 400
_LARGEST_STEP = 32767
_NAMES = ("shape.mean", "shape.modes", "shape.steps", "shape.deviations", "shape.segments")
_INVALID = (ArithmeticError, AttributeError, IndexError, KeyError, LookupError, TypeError, ValueError)


@lru_cache(maxsize=2)
def load_identity_model(path: Path | None = None) -> IdentityModel:
    """Return the morphable model in ``path``, or the shipped one if None.

    Raises:
        FacePoserError: If the file cannot be read, is damaged, or is of another topology.
    """
    path = path or asset_path("identity.npz")
    return _model_of(path, *read_identity_file(path))


def read_identity_file(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return the metadata and all arrays of the model file ``path``.

    Raises:
        FacePoserError: If it cannot be read, or is not a model file.
    """
    try:
        members = read_arrays(path, _MAX_BYTES, _MAX_MEMBERS)
    except TooLargeError:
        raise _unusable(path, "it is too large for a model of heads") from None
    except DamagedError as error:
        raise _unusable(path, str(error) or "it is damaged or is not a model file") from error
    except OSError as error:
        raise _unusable(path, f"it cannot be read ({error.strerror or error})") from error
    try:
        meta = parse_json(members.pop("meta").tobytes(), unique_keys=True)
    except (KeyError, FacePoserError):
        raise _unusable(path, "it is not a model file, since its metadata is missing") from None
    if not isinstance(meta, dict) or meta.get("format") != FORMAT:
        raise _unusable(path, "it is not a model of heads")
    if meta.get("version") != VERSION:
        raise _unusable(path, f"it has version {meta.get('version')!r}, and this program reads version {VERSION}")
    return meta, members


def save_identity_model(
    path: str | os.PathLike[str],
    model: IdentityModel,
    members: Mapping[str, NDArray[Any]] | None = None,
    meta: Mapping[str, Any] | None = None,
) -> None:
    """Write ``model`` to ``path``, atomically.

    Args:
        path: The file.
        model: A model with the topology of the built-in man.
        members: Arrays of other parts of the model by name, not beginning with "shape.".
        meta: Further metadata.

    Raises:
        FacePoserError: If the file cannot be written, or a number is not finite.
    """
    target = Path(path)
    basis = model.basis
    steps = np.maximum(np.abs(basis).max(axis=(1, 2)) / _LARGEST_STEP, 1e-12).astype(np.float32)
    values = {"mean": model.mean_vertices, "basis": basis, "deviations": model.standard_deviations}
    check_finite(target, "model of heads", *values.values(), model.noise, model.total_variance)
    check_finite(target, "model of heads", *(a for a in (members or {}).values() if a.dtype.kind == "f"))
    facts = {
        **(meta or {}),
        "format": FORMAT,
        "version": VERSION,
        "credits": model.credits,
        "n_heads": model.n_heads,
        "noise": model.noise,
        "total_variance": model.total_variance,
        "segments": list(model.segments.names) if model.segments else [],
    }
    arrays: dict[str, NDArray[Any]] = {
        **(members or {}),
        "meta": np.frombuffer(json_text(target, facts, "model of heads").encode(), dtype=np.uint8),
        "shape.mean": model.mean_vertices.astype(np.float32),
        "shape.modes": np.rint(basis / steps[:, None, None]).astype(np.int16),
        "shape.steps": steps,
        "shape.deviations": model.standard_deviations.astype(np.float32),
    }
    if model.segments is not None:
        arrays["shape.segments"] = np.rint(model.segments.weights * 65535.0).astype(np.uint16)
    with atomic_file(target, "model of heads") as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)


def _model_of(path: Path, meta: dict[str, Any], members: dict[str, NDArray[Any]]) -> IdentityModel:
    template = head_template()
    try:
        mean, modes, steps, deviations = (members[name].astype(np.float64) for name in _NAMES[:4])
        k, c = len(deviations), template.n_control
        if mean.shape != (c, 3) or modes.shape != (k, c, 3) or steps.shape != (k,) or k == 0:
            raise _unusable(path, "its heads do not have the topology of the built-in man")
        if (
            not all(np.isfinite(array).all() for array in (mean, modes, steps, deviations))
            or not (deviations > 0).all()
        ):
            raise ValueError("not finite")
        segments = None
        if "shape.segments" in members:
            weights = members["shape.segments"].astype(np.float64)
            if weights.shape != (len(meta["segments"]), c):
                raise ValueError("segments")
            segments = Segments(tuple(map(str, meta["segments"])), weights / weights.sum(axis=0))
        model = IdentityModel(k, template, segments, str(meta["credits"]))
        model.mean = mean.ravel()
        model.standard_deviations = deviations
        model.modes = (modes * steps[:, None, None]).reshape(k, -1) / deviations[:, None]
        model.noise, model.total_variance = float(meta["noise"]), float(meta["total_variance"])
        model.n_heads = int(meta["n_heads"])
        if not (np.isfinite(model.noise) and np.isfinite(model.total_variance)):
            raise ValueError("not finite")
    except _INVALID as error:
        raise _unusable(path, "its arrays do not belong together") from error
    return model


def _unusable(path: Path, reason: str) -> FacePoserError:
    remedy = "install Face Poser again, or give another file"
    return FacePoserError(f"The model of heads '{path}' cannot be used: {reason}; {remedy}.")
