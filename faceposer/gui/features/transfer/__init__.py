"""Transfer of expressions to other characters."""
