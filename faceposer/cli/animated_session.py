"""Sessions with an animation, as ``animate`` writes them beside it."""

from pathlib import Path
from typing import TYPE_CHECKING

from faceposer.errors import counted

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from faceposer.model.performance import Performance


def write_session(
    path: Path, character: str, performance: "Performance", tolerance: "float | NDArray[np.float64] | None" = None
) -> None:
    """Write a session of ``character`` with as few keys as reproduce ``performance`` within a ``tolerance``."""
    from faceposer.animation.keyframes import TOLERANCE, Keyframes
    from faceposer.session.opening import open_session

    session = open_session(character)
    dense = Keyframes.of_performance(performance)
    keyframes = dense.reduced(session.model, TOLERANCE if tolerance is None else tolerance)
    session.animation.load(keyframes, "Open an animation")
    session.wait()
    session.save(path)
    print(f"{path} written: {counted(len(keyframes.keys), 'key')}")
