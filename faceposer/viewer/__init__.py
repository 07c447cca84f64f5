"""The window: drawing, panels and events."""
