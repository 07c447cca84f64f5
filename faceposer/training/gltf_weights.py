"""Weights of morph targets from glTF files: their animation, or their defaults.

Section numbers refer to the Khronos glTF 2.0 specification, revision 2.0.1.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.files.sample_times import too_empty
from faceposer.geometry.gltf_file import GltfFile, GltfObject
from faceposer.model.shape_names import canonical_shape
from faceposer.training.key_times import Sampling, sampling
from faceposer.training.named_weights import NamedWeights
from faceposer.training.weight_range import in_range

Array = NDArray[np.float64]

_MAX_FRAMES = 1_000_000
_MAX_WEIGHTS = 50_000_000
_MAX_NAMES = 4_000
# Share of the shorter of two clips that lies in the time span of the other if they belong together.
_COMMON_SPAN = 0.5
# Difference between weights that is a conflict.
_CONFLICT = 1e-3


@dataclass(frozen=True, eq=False)
class _Curve:
    """The weights of one morph target of one mesh over time.

    Attributes:
        name: Name of the target.
        node: Index of the node with the mesh.
        mesh: Name of the node or mesh.
        times: Times of the K keys in seconds, shape (K,).
        weights: Weights, shape (K,).
        is_step: True if the weights are constant between keys (3.11).
        tangents: Tangents of a cubic spline before and after each key, shape (K, 2), or None.
    """

    name: str
    node: int
    mesh: str
    times: Array
    weights: Array
    is_step: bool = False
    tangents: Array | None = None

    @property
    def extent(self) -> float:
        """Range of the weights."""
        return float(np.ptp(self.weights))


@dataclass
class _Clip:
    """An animation of a file.

    Attributes:
        name: Name or number.
        curves: Curves of morph targets.
        unread: Number of channels by what they animate, such as "rotation", which are not read.
    """

    name: str
    curves: list[_Curve] = field(default_factory=list)
    unread: Counter[str] = field(default_factory=Counter)

    @property
    def span(self) -> tuple[float, float]:
        """Times of the first and last key."""
        return min(curve.times[0] for curve in self.curves), max(curve.times[-1] for curve in self.curves)

    @property
    def nodes(self) -> set[int]:
        """Nodes whose meshes it animates."""
        return {curve.node for curve in self.curves}


def read_gltf_weights(path: Path) -> NamedWeights:
    """Read the animation of morph targets in ``path``, resampled at a constant rate, or their default weights.

    The first animation with morph targets is read, together with those of other meshes in the same time span, as
    exporters that write one animation for each mesh need it. Of targets with the same name in several meshes, the one
    that varies most defines the weights. Curves are sampled from the first key to the last, those with few keys at a
    usual rate.

    Raises:
        FacePoserError: If the file cannot be read, is invalid, or has no morph targets with names.
    """
    try:
        file = GltfFile(path)
    except OSError as error:
        raise FacePoserError(f"The model '{path}' cannot be read: {error.strerror}.") from error
    clips = [_read_clip(file, animation, i) for i, animation in enumerate(file.all("animations"))]
    unread: Counter[str] = sum((clip.unread for clip in clips), Counter())
    omissions = (_channels_note(unread),) if unread else ()
    animated = [clip for clip in clips if clip.curves]
    if animated:
        curves, notes = _merged(animated)
        return _resampled(curves, path, (*notes, *omissions))
    curves = [curve for i, node in enumerate(file.all("nodes")) for curve in _default_weights(file, node, i)]
    if not curves:
        raise FacePoserError(f"The model '{path}' has no morph targets with names ('extras.targetNames').")
    chosen, notes = _chosen(curves, np.zeros(1))
    return NamedWeights(tuple(chosen), np.array([[curve[0] for curve in chosen.values()]]), None, (*notes, *omissions))


def _default_weights(file: GltfFile, node: GltfObject, number: int) -> Iterator[_Curve]:
    """Yield the default weights of the mesh of ``node`` as curves of one key."""
    if node.data.get("mesh") is None:
        return
    names = _target_names(file, node)
    if not names:
        return
    mesh = file.get("meshes", node, "mesh")
    owner = node if node.data.get("weights") is not None else mesh
    weights = owner.numbers("weights", [0.0] * len(names))
    for name, weight in zip(names, weights, strict=True):
        yield _Curve(name, number, _title(file, node), np.zeros(1), np.array([weight]))


def _title(file: GltfFile, node: GltfObject) -> str:
    return node.name() or file.get("meshes", node, "mesh").name() or node.place


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


def _read_clip(file: GltfFile, animation: GltfObject, number: int) -> _Clip:
    """Read the curves of morph targets of ``animation``, the file's animation ``number``."""
    clip = _Clip(animation.name() or f"animation {number + 1}")
    samplers = animation.children("samplers")
    for channel in animation.children("channels"):
        target = channel.child("target")
        kind = target.text("path")
        if kind != "weights" or target.data.get("node") is None:
            clip.unread[kind if kind in ("translation", "rotation", "scale") else "other"] += 1
            continue
        node = file.get("nodes", target, "node")
        names = [] if node.data.get("mesh") is None else _target_names(file, node)
        index = channel.integer("sampler")
        if not names or index >= len(samplers):
            clip.unread["weights"] += 1
            continue
        times, values, kind = _keys(file, samplers[index], len(names))
        title, is_step = _title(file, node), kind == "STEP"
        weights = values[:, len(values[0]) // 2]
        tangents = values[:, ::2] if kind == "CUBICSPLINE" else None
        clip.curves += [
            _Curve(
                name,
                target.integer("node"),
                title,
                times,
                weights[:, column],
                is_step,
                None if tangents is None else tangents[:, :, column],
            )
            for column, name in enumerate(names)
        ]
    return clip


def _keys(file: GltfFile, sampler: GltfObject, count: int) -> tuple[Array, Array, str]:
    """Return the times of a sampler, (K,), its values, (K, 1 or 3, ``count``), and its interpolation (3.11)."""
    times = file.floats(sampler, "input", "SCALAR")[:, 0].astype(np.float64)
    values = file.floats(sampler, "output", "SCALAR")[:, 0].astype(np.float64)
    kind = sampler.text("interpolation")
    # A cubic spline stores a tangent before and after each value.
    shape = (len(times), 3, count) if kind == "CUBICSPLINE" else (len(times), 1, count)
    if not len(times) or len(values) != int(np.prod(shape)):
        raise sampler.error(f"{len(values)} weights for {len(times)} key frames of {count} morph targets")
    wrong = np.flatnonzero(~np.isfinite(times))
    if len(wrong):
        raise sampler.error(f"the time of its key {wrong[0] + 1} is not finite")
    back = np.flatnonzero(np.diff(times) <= 0.0)
    if len(back):
        raise sampler.error(
            f"its times are not increasing: key {back[0] + 2} is at {times[back[0] + 1]:.6g} s after "
            f"{times[back[0]]:.6g} s"
        )
    values = values.reshape(shape)
    wrong = np.flatnonzero(~np.isfinite(values).all(axis=(1, 2)))
    if len(wrong):
        raise sampler.error(f"a weight of its key {wrong[0] + 1} is not finite")
    return times, values, kind


def _merged(clips: Sequence[_Clip]) -> tuple[list[_Curve], tuple[str, ...]]:
    """Return the curves of the first of ``clips`` and of those that belong to it, and notes."""
    first, *others = clips
    curves, nodes = list(first.curves), first.nodes
    merged, omitted = [first.name], []
    for clip in others:
        (begin, end), (clip_begin, clip_end) = first.span, clip.span
        common = min(end, clip_end) - max(begin, clip_begin)
        if common >= _COMMON_SPAN * min(end - begin, clip_end - clip_begin) and not nodes & clip.nodes:
            curves += clip.curves
            nodes |= clip.nodes
            merged.append(clip.name)
        else:
            omitted.append(clip.name)
    notes = []
    if len(merged) > 1:
        notes.append(f"The animations {_listed(merged)} of different meshes were merged.")
    if omitted:
        verb = "animation was" if len(omitted) == 1 else "animations were"
        notes.append(f"{len(omitted)} further {verb} not read: {_listed(omitted)}.")
    return curves, tuple(notes)


def _channels_note(unread: Counter[str]) -> str:
    count = sum(unread.values())
    said = "channel that moves no named morph target" if count == 1 else "channels that move no named morph target"
    kinds = ", ".join(f"{number} {kind}" for kind, number in sorted(unread.items()))
    return f"{count} {said} ({kinds}) {'was' if count == 1 else 'were'} not read."


def _listed(names: Sequence[str]) -> str:
    rest = len(names) - 3
    return ", ".join(f"'{name[:40]}'" for name in names[:3]) + (f" and {rest} more" if rest > 0 else "")


def _resampled(curves: list[_Curve], path: Path, notes: tuple[str, ...]) -> NamedWeights:
    """Return ``curves`` at even times, from their first key to their last."""
    curves, percent = _in_range(curves, path)
    even = sampling([curve.times for curve in curves], _MAX_FRAMES)
    if not isinstance(even, Sampling):
        raise FacePoserError(f"The animation in '{path}' has {even:.0f} frames, more than {_MAX_FRAMES}.")
    count = len(even.seconds)
    keys = max(len(curve.times) for curve in curves)
    if too_empty(count, keys):
        seconds = max(curve.times[-1] for curve in curves) - min(curve.times[0] for curve in curves)
        raise FacePoserError(
            f"The animation in '{path}' has {counted(keys, 'key')} in {seconds:.6g} seconds, which would become "
            f"{count:.0f} frames; correct its times or split it."
        )
    if count * len(curves) > _MAX_WEIGHTS:
        raise FacePoserError(
            f"The animation in '{path}' has {count:.0f} frames of {len(curves)} morph targets, more than can be read; "
            "export a shorter part of it."
        )
    sampled, conflicts = _chosen(curves, even.seconds)
    notes = (*percent, *notes, *conflicts, *([even.note] if even.note else []))
    return NamedWeights(tuple(sampled), np.stack([*sampled.values()], axis=1), even.rate, notes)


def _in_range(curves: list[_Curve], path: Path) -> tuple[list[_Curve], tuple[str, ...]]:
    """Return ``curves`` from 0 to 1, and the sentence about percentages.

    Shapes that are not ARKit's may have other ranges.
    """
    ours = [i for i, curve in enumerate(curves) if canonical_shape(curve.name) is not None]
    if not ours:
        return curves, ()
    found = in_range(np.concatenate([curves[i].weights for i in ours]))
    if found is None:
        worst = max((curves[i] for i in ours), key=lambda curve: float(np.abs(curve.weights).max()))
        raise FacePoserError(
            f"The weights of '{worst.name[:60]}' in '{path}' reach {np.abs(worst.weights).max():.4g}, which is neither "
            "of 0 to 1 nor of 0 to 100; export the animation again."
        )
    if not found[1]:
        return curves, ()
    scaled = list(curves)
    for i in ours:
        tangents = curves[i].tangents
        scaled[i] = replace(
            curves[i], weights=curves[i].weights / 100.0, tangents=None if tangents is None else tangents / 100.0
        )
    return scaled, (found[1],)


def _chosen(curves: Sequence[_Curve], sample_times: Array) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Return the weights at ``sample_times``, (F,), by name, and a note if meshes disagree.

    Of several meshes with a target, the one whose weights vary most defines it, or with the largest weight if none do.
    """
    by_name: dict[str, list[_Curve]] = {}
    for curve in curves:
        by_name.setdefault(curve.name, []).append(curve)
    sampled: dict[str, Array] = {}
    conflicts: list[tuple[_Curve, _Curve]] = []
    for name, group in by_name.items():
        best = max(group, key=lambda curve: (curve.extent, float(np.abs(curve.weights).max())))
        sampled[name] = _sample(best, sample_times)
        other = next((c for c in group if np.abs(_sample(c, sample_times) - sampled[name]).max() > _CONFLICT), None)
        if other is not None:
            conflicts.append((best, other))
    if not conflicts:
        return sampled, ()
    best, other = conflicts[0]
    count = "1 shape has" if len(conflicts) == 1 else f"{len(conflicts)} shapes have"
    return sampled, (
        f"{count} different weights in several meshes (such as '{best.name[:60]}' in '{best.mesh[:40]}' and "
        f"'{other.mesh[:40]}'); those that vary most were read.",
    )


def _sample(curve: _Curve, sample_times: Array) -> Array:
    """Return the weights of ``curve`` at ``sample_times``, shape (F,)."""
    if curve.is_step:
        weights: Array = curve.weights[np.clip(np.searchsorted(curve.times, sample_times + 1e-6, "right") - 1, 0, None)]
        return weights
    if curve.tangents is None or len(curve.times) < 2:
        return np.interp(sample_times, curve.times, curve.weights)
    # The Hermite spline of appendix C.5, constant outside its keys.
    at = np.clip(sample_times, curve.times[0], curve.times[-1])
    left = np.clip(np.searchsorted(curve.times, at, "right") - 1, 0, len(curve.times) - 2)
    step = curve.times[left + 1] - curve.times[left]
    t = (at - curve.times[left]) / step
    begin, end = curve.weights[left], curve.weights[left + 1]
    leaving, arriving = step * curve.tangents[left, 1], step * curve.tangents[left + 1, 0]
    return (
        (2.0 * t**3 - 3.0 * t**2 + 1.0) * begin
        + (t**3 - 2.0 * t**2 + t) * leaving
        + (3.0 * t**2 - 2.0 * t**3) * end
        + (t**3 - t**2) * arriving
    )
