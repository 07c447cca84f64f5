"""All that the user can do by a menu or a key, in one table: it feeds the menus, the sheet of keys and the tooltips."""

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from faceposer.errors import FacePoserError


def _always() -> bool:
    return True


@dataclass(frozen=True)
class Action:
    """One thing to do.

    Attributes:
        name: By which panels refer to it.
        label: As menus show it.
        menu: Title of its menu.
        run: Does it.
        keys: Shortcuts, such as "Ctrl+Shift+Z"; menus show the first.
        enabled: Whether it can be done now.
        checked: For a switch, whether it is on.
        repeats: Whether holding the key does it again and again.
        separated: Whether menus draw a line above it.
        help: One sentence for a tooltip, or "".
        listed: Whether menus and the sheet of keys show it; the others only have their key and the palette.
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

    @property
    def shortcut(self) -> str:
        """The first key as this system's users write it, or ""."""
        return shown_key(self.keys[0]) if self.keys else ""

    @property
    def tooltip(self) -> str:
        """Its name and its key, and below them what it does."""
        name = self.label.rstrip(".")
        first = f"{name}  ({self.shortcut})" if self.keys else name
        return f"{first}\n{self.help}" if self.help else first


@dataclass(frozen=True)
class Submenu:
    """A menu inside a menu whose entries change while the program runs.

    Attributes:
        name: By which panels refer to it.
        label: As menus show it.
        menu: Title of the menu that it is in.
        entries: Gives what it holds now.
        enabled: Whether it can be opened now.
        separated: Whether menus draw a line above it.
    """

    name: str
    label: str
    menu: str
    entries: Callable[[], list[Action]]
    enabled: Callable[[], bool] = _always
    separated: bool = False


class Actions:
    """The table, by name, menu and key."""

    def __init__(self, items: Iterable[Action | Submenu]) -> None:
        """Take over ``items`` in the order of the menus.

        Raises:
            ValueError: If two actions have the same name or the same key.
        """
        self._items = tuple(items)
        self._made = tuple(item for item in self._items if isinstance(item, Action))
        self._by_name: dict[str, Action] = {}
        self._by_key: dict[tuple[frozenset[str], str], Action] = {}
        for action in self._items:
            if isinstance(action, Submenu):
                continue
            if action.name in self._by_name:
                raise ValueError(f"two actions are called {action.name}")
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
        """Return all that ``menu`` shows, in order."""
        shown = (item for item in self._items if item.menu == menu)
        current = (item if isinstance(item, Submenu) else self._by_name[item.name] for item in shown)
        return [item for item in current if isinstance(item, Submenu) or item.listed]

    def in_menu(self, menu: str) -> list[Action]:
        """Return the actions that ``menu`` shows, in order."""
        return [action for action in self._by_name.values() if action.menu == menu and action.listed]

    def set_keys(self, changed: Mapping[str, Sequence[str]]) -> None:
        """Give the actions named in ``changed`` other keys, and all others those that they were made with.

        What names no action, is no key, or takes a key that another one has, is left out.
        """
        self._by_name = {action.name: action for action in self._made}
        for name, keys in changed.items():
            with suppress(FacePoserError):
                self.change_keys(name, keys)
        self._index()

    def change_keys(self, name: str, keys: Sequence[str]) -> None:
        """Give the action ``name`` the shortcuts ``keys``, as "Ctrl+Shift+Z" each, in place of those that it has.

        Raises:
            FacePoserError: If there is no such action, one is no key, or another action has it.
        """
        if name not in self._by_name:
            raise FacePoserError(f"There is no action '{name}'.")
        for key in keys:
            modifiers, plain = parsed_key(key)
            if not plain or not modifiers <= {"ctrl", "shift", "alt"}:
                raise FacePoserError(f"'{key}' is no key.")
            other = self.owner(key)
            if other is not None and other.name != name:
                raise FacePoserError(f"{shown_key(key)} is the key of {other.label.rstrip('.')}.")
        self._by_name[name] = replace(self._by_name[name], keys=tuple(keys))
        self._index()

    def owner(self, key: str) -> Action | None:
        """Return the action that has the shortcut ``key``, if any."""
        chord = parsed_key(key)
        found = (action for action in self._by_name.values() if chord in map(parsed_key, action.keys))
        return next(found, None)

    def usual_keys(self, name: str) -> tuple[str, ...]:
        """Return the keys that the action ``name`` was made with."""
        return next(action.keys for action in self._made if action.name == name)

    def _index(self) -> None:
        self._by_key = {parsed_key(key): action for action in self._by_name.values() for key in action.keys}

    def for_key(self, key: str, modifiers: frozenset[str]) -> Action | None:
        """Return the action on ``key`` with exactly ``modifiers``, if any."""
        return self._by_key.get((modifiers, key))


def parsed_key(text: str) -> tuple[frozenset[str], str]:
    """Return the modifiers and the key of a shortcut such as "Ctrl+Shift+Z"."""
    *modifiers, key = text.split("+")
    return frozenset(name.lower() for name in modifiers), key


def written_key(key: str, modifiers: frozenset[str]) -> str:
    """Return the shortcut of ``key`` with ``modifiers`` as ``parsed_key`` reads it."""
    return "+".join([*(name.title() for name in ("ctrl", "shift", "alt") if name in modifiers), key])


def shown_key(text: str) -> str:
    """Return a shortcut as this system's users write it."""
    return text.replace("Ctrl", "Cmd") if sys.platform == "darwin" else text
