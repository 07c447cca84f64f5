"""Sessions with an animation, as ``animate`` writes them beside it."""

from pathlib import Path
from typing import TYPE_CHECKING

from faceposer.errors import counted

if TYPE_CHECKING:
    from faceposer.model.performance import Performance


def write_session(path: Path, character: str, performance: "Performance") -> None:
    """Write a session of ``character`` with as few keys as reproduce ``performance``."""
    from faceposer.animation.keyframes import TOLERANCE, Keyframes
    from faceposer.session.opening import open_session

    session = open_session(character)
    dense = Keyframes.of_performance(performance)
    keyframes = dense.reduced(session.model, TOLERANCE)
    session.animation.load(keyframes, "Open an animation")
    session.wait()
    session.save(path)
    print(f"{path} written: {counted(len(keyframes.keys), 'key')}")
