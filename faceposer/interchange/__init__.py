"""Import and export of poses and animations."""
