"""Import of custom characters from files."""
