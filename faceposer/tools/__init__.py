"""Tools that turn pointer gestures into edits of the session; they know no window system."""
