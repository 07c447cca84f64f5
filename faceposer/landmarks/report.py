"""Landmarks as JSON (docs/landmarks.md)."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from faceposer.landmarks.feature_points import FeaturePlace, feature_pixels
from faceposer.landmarks.on_meshes import MeshLandmarks
from faceposer.landmarks.points import Landmarks

FORMAT, VERSION = "faceposer.landmarks", 1
_PIXEL_DIGITS, _SIGNIFICANT = 2, 7


def photo_report(source: str, size: tuple[int, int], faces: Sequence[Landmarks]) -> dict[str, Any]:
    """Return the landmarks of the ``faces`` of a photo of ``size``, width and height, as JSON."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "source": source,
        "kind": "photo",
        "size": list(size),
        "faces": [
            {
                "score": round(face.score, 6),
                "box": face.box.round(_PIXEL_DIGITS).tolist(),
                "points": face.points.round(_PIXEL_DIGITS).tolist(),
                "iris": face.iris.round(_PIXEL_DIGITS).tolist(),
                "feature_points": {
                    name: [round(u, _PIXEL_DIGITS), round(v, _PIXEL_DIGITS)]
                    for name, (u, v) in feature_pixels(face).items()
                },
            }
            for face in faces
        ],
    }


def mesh_report(source: str, found: MeshLandmarks, features: Mapping[str, FeaturePlace]) -> dict[str, Any]:
    """Return the landmarks and feature points of a mesh as JSON; places that no view sees are null."""
    frame = found.frame
    return {
        "format": FORMAT,
        "version": VERSION,
        "source": source,
        "kind": "mesh",
        "score": round(found.score, 6),
        "frame": {
            "scale": float(frame.scale),
            "rotation": frame.rotation.tolist(),
            "translation": frame.translation.tolist(),
        },
        "points": [_place(point) for point in found.points],
        "spread": [None if np.isnan(value) else _rounded(value) for value in found.spread],
        "pupils": [_place(pupil) for pupil in found.pupils],
        "feature_points": {
            name: {
                "title": feature.title,
                "place": [_rounded(value) for value in feature.place],
                "vertex": feature.vertex,
                "extrapolated": feature.extrapolated,
            }
            for name, feature in features.items()
        },
    }


def pins_report(face: Landmarks) -> dict[str, Any]:
    """Return the feature points of a face in a photo as pins (docs/photo.md)."""
    pins = [
        {"point": name, "pixel": [round(u, _PIXEL_DIGITS), round(v, _PIXEL_DIGITS)]}
        for name, (u, v) in feature_pixels(face).items()
    ]
    return {"format": "faceposer.pins", "version": 1, "pins": pins}


def _place(values: "np.ndarray[Any, np.dtype[np.float64]]") -> list[float] | None:
    return [_rounded(value) for value in values] if np.isfinite(values).all() else None


def _rounded(value: float) -> float:
    return float(f"{value:.{_SIGNIFICANT}g}")
