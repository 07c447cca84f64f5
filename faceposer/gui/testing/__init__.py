"""A scripted user of the real window, for tests and the demo."""
