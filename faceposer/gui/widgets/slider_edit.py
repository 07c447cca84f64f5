"""Keeps one edit of the session open while a slider is dragged: one drag is one step of the history."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass

from imgui_bundle import imgui

from faceposer.session.session import Session


class _Abandoned(Exception):
    """The drag of a slider was taken back."""


@dataclass
class _Open:
    key: str
    session: Session
    edit: AbstractContextManager[None]


class SliderEdit:
    """The slider that is being dragged, if any."""

    def __init__(self) -> None:
        self._open: _Open | None = None

    def dragging(self, key: str) -> bool:
        """Whether the slider ``key`` is being dragged."""
        return self._open is not None and self._open.key == key

    @property
    def active(self) -> bool:
        """Whether any slider is being dragged."""
        return self._open is not None

    def follow(
        self,
        session: Session,
        key: str,
        label: str,
        changed: bool,
        apply: Callable[[], None],
        begin: Callable[[], None] | None = None,
        merges: bool = False,
    ) -> None:
        """Open, continue or end the edit of the slider that was drawn last.

        Args:
            session: What it edits.
            key: Tells it from other sliders.
            label: Of the step in the history.
            changed: Whether its value has just changed.
            apply: Brings the value into the session, inside the edit.
            begin: Called when a drag begins, before anything changes.
            merges: Whether it joins the step before, if that has the same label.
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
            self._end(abandon=True)
        elif not imgui.is_item_active():
            self._end()

    def _end(self, abandon: bool = False) -> None:
        assert self._open is not None
        edit, self._open = self._open.edit, None
        if abandon:
            imgui.internal.clear_active_id()
            edit.__exit__(_Abandoned, _Abandoned(), None)
        else:
            edit.__exit__(None, None, None)

    def let_go(self) -> None:
        """End the drag, as when a dialog comes between or the slider is no longer drawn."""
        if self._open is not None:
            self._end()
