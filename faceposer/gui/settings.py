"""What the window remembers between runs: folders, navigation, its size. Losing it costs no more than comfort."""

import json
import math
from contextlib import suppress
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, get_args

from faceposer.errors import FacePoserError
from faceposer.files.atomic import write_text
from faceposer.files.user_folders import documents_folder, state_folder
from faceposer.render.options import Backdrop
from faceposer.tools.tool import Navigation

_FILE = "window.json"
_MAX_BYTES = 1 << 20
MAX_RECENT = 8
MAX_CHARACTERS = 30
#: Least and largest values of the numbers.
LIMITS = {"ui_scale": (0.75, 2.0), "key_light": (0.0, 2.0), "ambient_light": (0.0, 3.0)}


@dataclass
class Settings:
    """Remembered choices.

    Attributes:
        navigation: Which mouse buttons move the view.
        window_size: Width and height in the window system's units.
        export_path: Where the last OBJ went, or "".
        folder: Where the last session was opened or saved, or "".
        welcome_done: Whether the guided pose has been shown; it is on the first start, where nothing is remembered yet.
        poses_folder: Where the user's poses are, or "" for the usual folder.
        auto_key: Whether a changed pose becomes a key by itself, once there is any.
        range_marks: Whether the view shows how far the point under the pointer can go.
        expression_lines: Whether the lines of the skin that a pose makes are drawn.
        window_position: Top left corner of the window on the desktop, or None for the system's choice.
        window_maximized: Whether it fills the monitor.
        ui_scale: Factor on the size of text and panels.
        backdrop: What lies behind the face.
        key_light: Factor on the light from the front.
        ambient_light: Factor on the light from all sides.
        keys: Shortcuts that the user has changed, by the names of their actions.
        autosave_folder: Where unsaved work is kept, or "" for the usual folder; holds from the next start on.
        characters: Whole paths of the characters outside the library that were opened, newest first.
        recent: Whole paths of the files that were opened or saved last, newest first, at most ``MAX_RECENT``.
    """

    navigation: Navigation = "blender"
    window_size: tuple[int, int] = (1360, 860)
    export_path: str = ""
    folder: str = ""
    welcome_done: bool = True
    poses_folder: str = ""
    auto_key: bool = True
    range_marks: bool = True
    expression_lines: bool = True
    window_position: tuple[int, int] | None = None
    window_maximized: bool = False
    ui_scale: float = 1.0
    backdrop: Backdrop = "studio"
    key_light: float = 1.0
    ambient_light: float = 1.0
    keys: dict[str, list[str]] = field(default_factory=dict)
    autosave_folder: str = ""
    characters: list[str] = field(default_factory=list)
    recent: list[str] = field(default_factory=list)


def load_settings() -> Settings:
    """Return the settings of the last run; what is missing or damaged has its default."""
    try:
        path = state_folder() / _FILE
        data = json.loads(path.read_text(encoding="utf-8")) if path.stat().st_size < _MAX_BYTES else {}
    except (OSError, ValueError, RecursionError):
        data = {}
    # Where nothing is remembered, somebody is new here.
    settings = Settings(welcome_done=bool(data))
    if isinstance(data, dict):
        for setting in fields(Settings):
            value = _checked(setting.name, data.get(setting.name))
            if value is not None:
                setattr(settings, setting.name, value)
    return settings


def save_settings(settings: Settings) -> None:
    """Write the settings; a folder that cannot be written is no reason to bother the user."""
    path = state_folder() / _FILE
    with suppress(OSError, FacePoserError):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, json.dumps(asdict(settings), indent=1) + "\n", "settings")


def last_folder(settings: Settings) -> Path:
    """Return the folder in which a file dialog opens: the last one, or the user's documents."""
    folder = Path(settings.folder) if settings.folder else documents_folder()
    return folder if folder.is_dir() else Path.home()


def _checked(name: str, value: Any) -> Any:
    """Return ``value`` if the setting ``name`` can have it, else None."""
    if name == "navigation":
        return value if value in get_args(Navigation) else None
    if name == "window_size":
        sound = isinstance(value, list) and len(value) == 2 and all(isinstance(v, int) for v in value)
        return (min(max(value[0], 480), 16384), min(max(value[1], 360), 16384)) if sound else None
    if name == "window_position":
        sound = isinstance(value, list) and len(value) == 2 and all(isinstance(v, int) for v in value)
        return (value[0], value[1]) if sound else None
    if name in ("welcome_done", "auto_key", "range_marks", "expression_lines", "window_maximized"):
        return value if isinstance(value, bool) else None
    if name in LIMITS:
        sound = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        return min(max(float(value), LIMITS[name][0]), LIMITS[name][1]) if sound else None
    if name == "backdrop":
        return value if value in get_args(Backdrop) else None
    if name == "keys":
        return _checked_keys(value)
    if name in ("recent", "characters"):
        listed = value if isinstance(value, list) else []
        most = MAX_RECENT if name == "recent" else MAX_CHARACTERS
        return [path for path in listed if _is_whole_path(path)][:most]
    return value if isinstance(value, str) else None


def _checked_keys(value: Any) -> dict[str, list[str]]:
    entries = value.items() if isinstance(value, dict) else ()
    return {
        name: keys
        for name, keys in entries
        if isinstance(keys, list) and len(keys) <= 4 and all(isinstance(key, str) and 0 < len(key) < 40 for key in keys)
    }


def _is_whole_path(value: Any) -> bool:
    return isinstance(value, str) and "\0" not in value and Path(value).is_absolute()
