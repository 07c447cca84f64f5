"""Transfer of expressions between characters."""
