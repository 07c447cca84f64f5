"""Sessions with an animation, as ``animate`` writes them beside it."""

from pathlib import Path
from typing import TYPE_CHECKING

from faceposer.errors import counted

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from faceposer.animation.keyframes import FilmSource
    from faceposer.model.performance import Performance


def write_session(
    path: Path,
    character: str,
    performance: "Performance",
    tolerance: "float | NDArray[np.float64] | None" = None,
    film: "FilmSource | None" = None,
) -> None:
    """Write a session of ``character`` with as few keys as reproduce ``performance`` within a ``tolerance``.

    Args:
        path: The file.
        character: Name or path of the character.
        performance: The animation.
        tolerance: Largest error of a rig weight, or of each, shape (S,); the usual one if None.
        film: The film that the animation follows, or None.
    """
    from dataclasses import replace

    from faceposer.animation.keyframes import TOLERANCE, Keyframes
    from faceposer.session.opening import open_session

    session = open_session(character)
    dense = Keyframes.of_performance(performance)
    keyframes = dense.reduced(session.model, TOLERANCE if tolerance is None else tolerance)
    session.animation.load(replace(keyframes, film=film), "Open an animation")
    session.wait()
    session.save(path)
    print(f"{path} written: {counted(len(keyframes.keys), 'key')}")
