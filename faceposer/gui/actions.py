"""Actions: commands of menus and keys, in one table for menus, tooltips, the command palette and the keymap."""

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from faceposer.errors import FacePoserError

#: Between the parts of a hint in the status bar.
HINT_SEPARATOR = "   ·   "


def _always() -> bool:
    return True


@dataclass(frozen=True)
class Action:
    """A command of the window.

    Attributes:
        name: Identifier for panels and the keymap.
        label: Text of the menu entry.
        menu: Title of the menu.
        run: Executes the action.
        keys: Shortcuts, such as "Ctrl+Shift+Z"; menus show the first.
        enabled: Returns True if the action is available.
        checked: Returns True if a switch is on; None for other actions.
        repeats: True if the action repeats while the key is held.
        separated: True if menus draw a separator above the entry.
        help: One sentence for a tooltip, or "".
        listed: True if menus and the list of keys show the action; all are in the command palette.
        also: Title of another menu that shows the action, too, or "".
    """

    name: str
    label: str
    menu: str
    run: Callable[[], object]
    keys: tuple[str, ...] = ()
    enabled: Callable[[], bool] = _always
    checked: Callable[[], bool] | None = None
    repeats: bool = False
    separated: bool = False
    help: str = ""
    listed: bool = True
    also: str = ""

    @property
    def shortcut(self) -> str:
        """The first key in the notation of the operating system, or ""."""
        return display_key(self.keys[0]) if self.keys else ""

    @property
    def bracketed_shortcut(self) -> str:
        """The shortcut in brackets, to be appended to a tooltip, or ""."""
        return f"  ({self.shortcut})" if self.keys else ""

    @property
    def tooltip(self) -> str:
        """Label and key, with the help text below."""
        name = self.label.rstrip(".")
        first = f"{name}{self.bracketed_shortcut}"
        return f"{first}\n{self.help}" if self.help else first


@dataclass(frozen=True)
class Submenu:
    """A menu within a menu, with entries that change at run time.

    Attributes:
        name: Identifier.
        label: Text of the menu entry.
        menu: Title of the parent menu.
        entries: Returns the current entries.
        enabled: Returns True if the submenu is available.
        separated: True if menus draw a separator above the entry.
    """

    name: str
    label: str
    menu: str
    entries: Callable[[], list[Action]]
    enabled: Callable[[], bool] = _always
    separated: bool = False


class Actions:
    """The table of actions, indexed by name, menu and key."""

    def __init__(self, items: Iterable[Action | Submenu]) -> None:
        """Add ``items``, in the order of the menus.

        Raises:
            ValueError: If two actions have the same name or the same key.
        """
        self._items = tuple(items)
        self._defaults = tuple(item for item in self._items if isinstance(item, Action))
        self._by_name: dict[str, Action] = {}
        self._by_key: dict[tuple[frozenset[str], str], Action] = {}
        for action in self._items:
            if isinstance(action, Submenu):
                continue
            if action.name in self._by_name:
                raise ValueError(f"two actions have the name {action.name}")
            self._by_name[action.name] = action
            for key in action.keys:
                chord = parsed_key(key)
                if chord in self._by_key:
                    raise ValueError(f"two actions have the key {key}")
                self._by_key[chord] = action

    def __getitem__(self, name: str) -> Action:
        return self._by_name[name]

    def __iter__(self) -> Iterator[Action]:
        return iter(self._by_name.values())

    @property
    def menus(self) -> list[str]:
        """The titles of the menus, in order."""
        return list(dict.fromkeys(item.menu for item in self._items))

    def items(self, menu: str) -> list[Action | Submenu]:
        """Return the entries of ``menu``, in order; those of other menus that it shows, too, are first."""
        entries = (
            item for item in self._items if item.menu == menu or (isinstance(item, Action) and item.also == menu)
        )
        current = (item if isinstance(item, Submenu) else self._by_name[item.name] for item in entries)
        return [item for item in current if isinstance(item, Submenu) or item.listed]

    def in_menu(self, menu: str) -> list[Action]:
        """Return the actions listed in ``menu``, in order."""
        return [action for action in self._by_name.values() if action.menu == menu and action.listed]

    def set_keys(self, changed: Mapping[str, Sequence[str]]) -> None:
        """Apply the keymap ``changed``, from names of actions to shortcuts; other actions get their default keys.

        Entries that name no action, are not a key, or use the key of another action are ignored.
        """
        self._by_name = {action.name: action for action in self._defaults}
        for name, keys in changed.items():
            with suppress(FacePoserError):
                self.change_keys(name, keys)
        self._index()

    def change_keys(self, name: str, keys: Sequence[str]) -> None:
        """Replace the shortcuts of the action ``name`` by ``keys``, such as "Ctrl+Shift+Z".

        Raises:
            FacePoserError: If there is no such action, or a key is not valid or belongs to another action.
        """
        if name not in self._by_name:
            raise FacePoserError(f"There is no action '{name}'.")
        for key in keys:
            modifiers, plain = parsed_key(key)
            if not plain or not modifiers <= {"ctrl", "shift", "alt"}:
                raise FacePoserError(f"'{key}' is not a key.")
            other = self.owner(key)
            if other is not None and other.name != name:
                raise FacePoserError(f"{display_key(key)} is already the key of {other.label.rstrip('.')}.")
        self._by_name[name] = replace(self._by_name[name], keys=tuple(keys))
        self._index()

    def owner(self, key: str) -> Action | None:
        """Return the action with the shortcut ``key``, if any."""
        chord = parsed_key(key)
        found = (action for action in self._by_name.values() if chord in map(parsed_key, action.keys))
        return next(found, None)

    def default_keys(self, name: str) -> tuple[str, ...]:
        """Return the default keys of the action ``name``."""
        return next(action.keys for action in self._defaults if action.name == name)

    def with_current_keys(self, hint: str) -> str:
        """Return ``hint`` with the keys of the present keymap.

        A hint consists of parts such as "Enter: apply" or "[ ]: brush width". Default keys in front of a colon are
        replaced by the present ones; parts whose action has no key are left out.
        """
        parts = []
        for part in hint.split(HINT_SEPARATOR):
            keys, colon, text = part.partition(": ")
            names = [self._default_owner(key) for key in keys.split()] if colon else []
            actions = [self._by_name[name] for name in names if name is not None]
            if not names or len(actions) < len(names):
                parts.append(part)
            elif all(action.keys for action in actions):
                parts.append(f"{' '.join(action.shortcut for action in actions)}: {text}")
        return HINT_SEPARATOR.join(parts)

    def _default_owner(self, key: str) -> str | None:
        """Return the name of the action that has ``key`` by default, if any."""
        return next((action.name for action in self._defaults if key in action.keys), None)

    def _index(self) -> None:
        self._by_key = {parsed_key(key): action for action in self._by_name.values() for key in action.keys}

    def for_key(self, key: str, modifiers: frozenset[str]) -> Action | None:
        """Return the action for ``key`` with exactly ``modifiers``, if any."""
        return self._by_key.get((modifiers, key))


def parsed_key(text: str) -> tuple[frozenset[str], str]:
    """Return the modifiers and the key of a shortcut such as "Ctrl+Shift+Z"."""
    *modifiers, key = text.split("+")
    return frozenset(name.lower() for name in modifiers), key


def format_key(key: str, modifiers: frozenset[str]) -> str:
    """Return the shortcut of ``key`` with ``modifiers``, the inverse of ``parsed_key``."""
    return "+".join([*(name.title() for name in ("ctrl", "shift", "alt") if name in modifiers), key])


def display_key(text: str) -> str:
    """Return a shortcut in the notation of the operating system."""
    return text.replace("Ctrl", "Cmd") if sys.platform == "darwin" else text
