"""What the user sets for all sessions."""
