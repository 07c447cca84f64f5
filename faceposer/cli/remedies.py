"""Commands for files that are given in place of a session."""

from pathlib import Path

from faceposer.session.file_kinds import Kind, kind_of

_ANIMATION = "'faceposer export CHARACTER --animation FILE -o OUT.glb' applies a performance to a character"
_ANIMATE = "'faceposer animate CHARACTER FILE -o OUT.json' follows recorded points"
_REMEDIES: dict[Kind, str] = {
    "performance": _ANIMATION,
    "weights": f"{_ANIMATION}, and 'faceposer export CHARACTER --pose FILE -o OUT.obj' a pose",
    "trajectories": f"{_ANIMATE}, and 'faceposer train --markers FILE' learns a character from them",
    "table": f"{_ANIMATION}; {_ANIMATE}",
    "pose": "a pose of the library is applied in the window, or by 'Face.apply_pose' in Python; 'faceposer transfer "
    "FILE CHARACTER -o OUT.json' makes a session of it",
    "rig": f"'faceposer train --rig FILE -o OUT.npz' makes a character of a rig; {_ANIMATION}",
    "mesh": "'faceposer export CHARACTER --pose FILE -o OUT.json' reads a posed mesh, and 'faceposer train --rig "
    "FOLDER -o OUT.npz' a folder of shapes",
    "photo": "'faceposer photo CHARACTER FILE --pins PINS -o OUT.json' poses a character from a photo",
    "drawing": "'faceposer sketch CHARACTER FILE -o OUT.json' poses a character by a drawing",
    "folder": "'faceposer train --rig FOLDER -o OUT.npz' makes a character of a folder of shapes, and --examples one "
    "of a folder of expressions",
}


def remedy_for(path: Path) -> str:
    """Return a sentence about the command for the file ``path``, with a space before it, or ""."""
    text = _REMEDIES.get(kind_of(path), "")
    return f" {text[0].upper()}{text[1:]}." if text else ""
