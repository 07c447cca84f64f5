"""The guided first pose."""
