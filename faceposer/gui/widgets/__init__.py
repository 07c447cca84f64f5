"""Widgets of the window that know nothing of faces: theme, dialogs, file dialogs, small building blocks."""
