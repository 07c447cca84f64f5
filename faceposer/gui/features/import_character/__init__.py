"""Custom characters made from files."""
