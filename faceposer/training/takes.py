"""Takes of Live Link Face, Face Cap and other programs as weights frame by frame."""

from pathlib import Path

from faceposer.files.sample_times import interpolated
from faceposer.training.capture import read_capture
from faceposer.training.named_weights import NamedWeights


def read_take(path: Path, rate: float | None = None) -> NamedWeights:
    """Return the weights in the take ``path`` at even times, and what was assumed and interpolated.

    Args:
        path: A text table.
        rate: Frames per second in place of those of the file.

    Raises:
        FacePoserError: If the file cannot be read.
    """
    capture = read_capture(path)
    assert capture.clock is not None
    frames = capture.clock.frames(path, rate)
    weights, gaps = interpolated(frames, capture.clock.seen, capture.weights)
    return NamedWeights(capture.shape_names, weights, frames.rate, (*capture.notes, *frames.notes, *gaps))
