"""Tools that turn pointer gestures into edits of the session, independent of the window system."""
