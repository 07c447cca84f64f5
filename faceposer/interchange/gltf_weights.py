"""Weights of morph targets from glTF files: their animation, or their defaults.

Section numbers refer to the Khronos glTF 2.0 specification, revision 2.0.1.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.gltf_file import GltfFile, GltfObject
from faceposer.interchange.named_weights import NamedWeights

Array = NDArray[np.float64]

_MAX_FRAMES = 1_000_000
_LOWEST_RATE, _HIGHEST_RATE = 1.0, 240.0
_MAX_NAMES = 10_000


def read_gltf_weights(path: Path) -> NamedWeights:
    """Read the first animation of morph targets in ``path``, resampled at a constant rate, or their default weights.

    Targets with the same name in several meshes are merged; the first of these meshes defines the weights. CUBICSPLINE
    curves are treated as linear between their keys.

    Raises:
        FacePoserError: If the file cannot be read, is invalid, or has no morph targets with names.
    """
    try:
        file = GltfFile(path)
    except OSError as error:
        raise FacePoserError(f"The model '{path}' cannot be read: {error.strerror}.") from error
    for animation in file.all("animations"):
        curves = list(_curves(file, animation))
        if curves:
            return _resampled(curves, path)
    names: dict[str, float] = {}
    for node in file.all("nodes"):
        if node.data.get("mesh") is not None:
            targets = _target_names(file, node)
            if not targets:
                continue
            mesh = file.get("meshes", node, "mesh")
            owner = node if node.data.get("weights") is not None else mesh
            for name, weight in zip(targets, owner.numbers("weights", [0.0] * len(targets)).tolist(), strict=True):
                names.setdefault(name, weight)
    if not names:
        raise FacePoserError(f"The model '{path}' has no morph targets with names ('extras.targetNames').")
    return NamedWeights(tuple(names), np.array([[*names.values()]]), None)


def _target_names(file: GltfFile, node: GltfObject) -> list[str]:
    """Return the names of the morph targets of the mesh of ``node``."""
    mesh = file.get("meshes", node, "mesh")
    primitives = mesh.children("primitives")
    count = len(primitives[0].children("targets")) if primitives else 0
    names = mesh.child("extras").names("targetNames")
    if not names and primitives:
        names = primitives[0].child("extras").names("targetNames")
    if not names or not count:
        return []
    if count > _MAX_NAMES:
        raise mesh.error(f"it has {count} morph targets, more than {_MAX_NAMES}")
    return (names + [f"target {i + 1}" for i in range(len(names), count)])[:count]


def _curves(file: GltfFile, animation: GltfObject) -> Iterator[tuple[str, Array, Array, bool]]:
    """Yield the name, times and weights of each animated morph target, and True if it is a step function (3.11)."""
    samplers = animation.children("samplers")
    for channel in animation.children("channels"):
        target = channel.child("target")
        if target.text("path") != "weights" or target.data.get("node") is None:
            continue
        node = file.get("nodes", target, "node")
        if node.data.get("mesh") is None:
            continue
        names = _target_names(file, node)
        number = channel.integer("sampler")
        if not names or number >= len(samplers):
            continue
        sampler = samplers[number]
        times = file.floats(sampler, "input", "SCALAR")[:, 0].astype(np.float64)
        values = file.floats(sampler, "output", "SCALAR")[:, 0].astype(np.float64)
        kind = sampler.text("interpolation")
        # A cubic spline stores a tangent before and after each value.
        shape = (len(times), 3, len(names)) if kind == "CUBICSPLINE" else (len(times), 1, len(names))
        if not len(times) or len(values) != int(np.prod(shape)):
            raise sampler.error(f"{len(values)} weights for {len(times)} key frames of {len(names)} morph targets")
        if not (np.isfinite(times).all() and np.isfinite(values).all() and (np.diff(times) > 0).all()):
            raise sampler.error("its times are not increasing, or a number is not finite")
        weights = values.reshape(shape)[:, shape[1] // 2]
        for column, name in enumerate(names):
            yield name, times, weights[:, column], kind == "STEP"


def _resampled(curves: list[tuple[str, Array, Array, bool]], path: Path) -> NamedWeights:
    """Return ``curves`` sampled at the rate of the curve with the most keys, from their first key to their last."""
    densest = max((times for _, times, _, _ in curves), key=len)
    interval = float(np.median(np.diff(densest))) if len(densest) > 1 else 1.0
    rate = round(float(np.clip(1.0 / interval, _LOWEST_RATE, _HIGHEST_RATE)), 2)
    begin = min(times[0] for _, times, _, _ in curves)
    end = max(times[-1] for _, times, _, _ in curves)
    count = (end - begin) * rate + 1
    if not count <= _MAX_FRAMES:
        raise FacePoserError(f"The animation in '{path}' has {count:.0f} frames, more than {_MAX_FRAMES}.")
    sample_times = begin + np.arange(int(count + 1e-3)) / rate
    sampled: dict[str, Array] = {}
    for name, times, weights, is_step in curves:
        if name in sampled:
            continue
        if is_step:
            sampled[name] = weights[np.clip(np.searchsorted(times, sample_times + 1e-6, "right") - 1, 0, None)]
        else:
            sampled[name] = np.interp(sample_times, times, weights)
    return NamedWeights(tuple(sampled), np.stack([*sampled.values()], axis=1), rate)
