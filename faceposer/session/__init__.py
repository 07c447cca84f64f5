"""The edited document with its undo history, its file and the background solver."""
