"""Preferences for all sessions."""
