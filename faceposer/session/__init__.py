"""The document that a user edits: its history, its file and its background solves."""
