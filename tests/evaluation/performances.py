"""Made-up performances as files, for studies that take a second."""

from pathlib import Path

import numpy as np

from faceposer.model.character import ARKIT_SHAPES


def weights(frames: int, seed: int) -> np.ndarray:
    """Return weights, (frames, 52), in which a few expressions come and go, smoothly from frame to frame."""
    rng = np.random.default_rng(seed)
    times = np.linspace(0.0, 1.0, frames)
    found = np.zeros((frames, len(ARKIT_SHAPES)))
    for names in (("mouthSmileLeft", "mouthSmileRight"), ("jawOpen",), ("browInnerUp",), ("mouthPucker",)):
        strength = 0.4 - 0.4 * np.cos(2 * np.pi * (rng.integers(1, 4) * times + rng.random()))
        for name in names:
            found[:, ARKIT_SHAPES.index(name)] = strength
    return found


def write_take(path: Path, frames: np.ndarray, frames_a_second: float = 30.0) -> Path:
    """Write ``frames``, (F, 52), as Live Link Face does, and return the ``path``."""
    header = ["Timecode", "BlendShapeCount", *(name[0].upper() + name[1:] for name in ARKIT_SHAPES)]
    lines = [",".join(header)]
    for i, frame in enumerate(frames):
        second, part = divmod(i / frames_a_second, 1.0)
        time = f"10:{int(second) // 60:02}:{int(second) % 60:02}:{int(part * 30):02}.000"
        lines.append(",".join([time, "52", *(f"{value:.6f}" for value in frame)]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
