"""Edits by sliders: a drag is one step of the history."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass

from imgui_bundle import imgui

from faceposer.session.session import Session


class _Cancelled(Exception):
    """The drag of a slider was cancelled."""


@dataclass
class _Open:
    key: str
    session: Session
    edit: AbstractContextManager[None]


class SliderEdit:
    """The edit of the session during the drag of a slider."""

    def __init__(self) -> None:
        self._open: _Open | None = None

    def dragging(self, key: str) -> bool:
        """Return True if the slider ``key`` is being dragged."""
        return self._open is not None and self._open.key == key

    @property
    def active(self) -> bool:
        """True if a slider is being dragged."""
        return self._open is not None

    def update(
        self,
        session: Session,
        key: str,
        label: str,
        changed: bool,
        apply: Callable[[], None],
        begin: Callable[[], None] | None = None,
        merges: bool = False,
    ) -> None:
        """Start, continue or end the edit of the last drawn slider.

        Args:
            session: The session.
            key: Identifier of the slider.
            label: Label of the step in the history.
            changed: True if the value has just changed.
            apply: Applies the value to the session, within the edit.
            begin: Called at the start of a drag, before any change.
            merges: True if the edit is merged with the previous step, provided that their labels are equal.
        """
        if imgui.is_item_activated() and not session.editing:
            if begin is not None:
                begin()
            edit = session.edit(label, merges)
            edit.__enter__()
            self._open = _Open(key, session, edit)
        if not self.dragging(key):
            return
        if changed:
            apply()
        if imgui.is_key_pressed(imgui.Key.escape, False):
            self._end(cancel=True)
        elif not imgui.is_item_active():
            self._end()

    def _end(self, cancel: bool = False) -> None:
        assert self._open is not None
        edit, self._open = self._open.edit, None
        if cancel:
            imgui.internal.clear_active_id()
            edit.__exit__(_Cancelled, _Cancelled(), None)
        else:
            edit.__exit__(None, None, None)

    def let_go(self) -> None:
        """End the drag, for example when a dialog opens or the slider is no longer drawn."""
        if self._open is not None:
            self._end()
