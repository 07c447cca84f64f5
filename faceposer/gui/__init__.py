"""The window: the frame loop, input, and the packages of widgets, panels, overlays and features."""
