"""Widgets independent of faces: theme, dialogs, file dialogs and small building blocks."""
