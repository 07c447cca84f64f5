"""What the window remembers between runs: folders, navigation, its size. Losing it costs no more than comfort."""

import json
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, get_type_hints

from faceposer.errors import FacePoserError
from faceposer.files.atomic import write_text
from faceposer.files.json_documents import convert, read_json
from faceposer.files.user_folders import state_folder
from faceposer.tools.tool import Navigation

_FILE = "window.json"
MAX_RECENT = 8


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
    """Return the folder in which a file dialog opens."""
    folder = Path(settings.folder) if settings.folder else Path.cwd()
    return folder if folder.is_dir() else Path.home()


def _settings_from_json(data: Any) -> dict[str, Any]:
    """Return those of the remembered settings that can be used, by name."""
    usable: dict[str, Any] = {}
    if not data:
        return usable
    for name, kind in get_type_hints(Settings).items():
        with suppress(FacePoserError, KeyError, TypeError):
            usable[name] = convert(data[name], list if name == "recent" else kind)
    if "window_size" in usable:
        width, height = usable["window_size"]
        usable["window_size"] = (min(max(width, 480), 16384), min(max(height, 360), 16384))
    usable["recent"] = [path for path in usable.get("recent", []) if _is_whole_path(path)][:MAX_RECENT]
    return usable


def _is_whole_path(value: Any) -> bool:
    return isinstance(value, str) and "\0" not in value and Path(value).is_absolute()
