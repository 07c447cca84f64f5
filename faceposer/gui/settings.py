"""Settings kept between runs, such as folders, navigation and the window's size; damaged settings get defaults."""

import math
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, get_type_hints

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.files.json_documents import convert, read_json
from faceposer.files.user_folders import documents_folder, state_folder
from faceposer.files.writing import write_json
from faceposer.render.options import Backdrop
from faceposer.tools.tool import Navigation

_FILE = "window.json"
MAX_RECENT = 8
MAX_CHARACTERS = 30
#: Minimum and maximum of numeric settings.
LIMITS = {"ui_scale": (0.75, 2.0), "key_light": (0.0, 2.0), "ambient_light": (0.0, 3.0)}


@dataclass
class Settings:
    """Settings of the window.

    Attributes:
        navigation: Program whose mouse buttons navigate the view.
        window_size: Width and height in the window system's units.
        export_path: Path of the last saved OBJ, or "".
        folder: Folder of the last opened or saved session, or "".
        welcome_done: True if the guided pose has been shown; False on the first start, without saved settings.
        poses_folder: Folder of the user's poses, or "" for the default.
        keys_folder: Folder of the key poses that were opened last, or "".
        auto_key: True if a changed pose is keyed automatically, once there is a key.
        range_marks: True if the view shows the range of the point under the pointer.
        expression_lines: True if expression lines are drawn.
        materials: True if OBJ files are written with materials and textures.
        window_position: Top left corner of the window on the desktop, or None for the system's choice.
        window_maximized: True if the window is maximized.
        ui_scale: Scale of text and panels.
        backdrop: Background of the face.
        key_light: Factor of the light from the front.
        ambient_light: Factor of the light from all sides.
        keys: Shortcuts changed by the user, by the names of the actions.
        autosave_folder: Folder of unsaved work, or "" for the default; takes effect at the next start.
        characters: Absolute paths of opened character files outside the library, newest first.
        recent: Absolute paths of recently opened or saved files, newest first, at most ``MAX_RECENT``.
    """

    navigation: Navigation = "blender"
    window_size: tuple[int, int] = (1360, 860)
    export_path: str = ""
    folder: str = ""
    welcome_done: bool = True
    poses_folder: str = ""
    keys_folder: str = ""
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
    """Return the settings of the last run, with defaults for missing and damaged ones."""
    try:
        data = read_json(state_folder() / _FILE, "settings", _settings_from_json)
    except FacePoserError:
        data = {}
    # Without saved settings this is the first start.
    settings = Settings(welcome_done=bool(data))
    for name, value in data.items():
        setattr(settings, name, value)
    return settings


def save_settings(settings: Settings) -> None:
    """Write the settings.

    Raises:
        FacePoserError: If they cannot be written.
    """
    path = state_folder() / _FILE
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FacePoserError(f"The settings '{path}' cannot be written: {error.strerror}.") from error
    write_json(path, asdict(settings), "settings")


def last_folder(settings: Settings) -> Path:
    """Return the initial folder of file dialogs: the last one, or the user's documents."""
    folder = Path(settings.folder)
    return folder if settings.folder and paths.can_enter(folder) else documents_folder()


def _settings_from_json(data: Any) -> dict[str, Any]:
    """Return the valid settings in ``data``, by name."""
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
        usable[name] = [path for path in usable.get(name, []) if _is_absolute_path(path)][:most_paths]
    return usable


def _checked_keys(value: Any) -> dict[str, list[str]]:
    entries = value.items() if isinstance(value, dict) else ()
    return {
        name: keys
        for name, keys in entries
        if isinstance(keys, list) and len(keys) <= 4 and all(_is_key(key) for key in keys)
    }


def _is_key(value: Any) -> bool:
    return isinstance(value, str) and 0 < len(value) < 40 and value.isprintable() and "##" not in value


def _is_absolute_path(value: Any) -> bool:
    return isinstance(value, str) and "\0" not in value and Path(value).is_absolute()
