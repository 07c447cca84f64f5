"""What the window remembers between runs: folders, navigation, its size. Losing it costs no more than comfort."""

import json
import math
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, get_type_hints

from faceposer.errors import FacePoserError
from faceposer.files.atomic import write_text
from faceposer.files.json_documents import convert, read_json
from faceposer.files.user_folders import documents_folder, state_folder
from faceposer.render.options import Backdrop
from faceposer.tools.tool import Navigation

_FILE = "window.json"
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
        materials: Whether OBJ files are written with materials and textures.
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
    materials: bool = True
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
        data = read_json(state_folder() / _FILE, "settings", _settings_from_json)
    except FacePoserError:
        data = {}
    # Where nothing is remembered, somebody is new here.
    settings = Settings(welcome_done=bool(data))
    for name, value in data.items():
        setattr(settings, name, value)
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


def _settings_from_json(data: Any) -> dict[str, Any]:
    """Return those of the remembered settings that can be used, by name."""
    usable: dict[str, Any] = {}
    if not data:
        return usable
    loose = {"recent": list, "characters": list, "keys": dict}
    for name, kind in get_type_hints(Settings).items():
        with suppress(FacePoserError, KeyError, TypeError):
            usable[name] = convert(data[name], loose.get(name, kind))
    if "window_size" in usable:
        width, height = usable["window_size"]
        usable["window_size"] = (min(max(width, 480), 16384), min(max(height, 360), 16384))
    for name, (least, most) in LIMITS.items():
        if name in usable and math.isfinite(number := usable.pop(name)):
            usable[name] = min(max(float(number), least), most)
    usable["keys"] = _checked_keys(usable.get("keys", {}))
    for name, most_paths in (("recent", MAX_RECENT), ("characters", MAX_CHARACTERS)):
        usable[name] = [path for path in usable.get(name, []) if _is_whole_path(path)][:most_paths]
    return usable


def _checked_keys(value: Any) -> dict[str, list[str]]:
    entries = value.items() if isinstance(value, dict) else ()
    return {
        name: keys
        for name, keys in entries
        if isinstance(keys, list) and len(keys) <= 4 and all(isinstance(key, str) and 0 < len(key) < 40 for key in keys)
    }


def _is_whole_path(value: Any) -> bool:
    return isinstance(value, str) and "\0" not in value and Path(value).is_absolute()
