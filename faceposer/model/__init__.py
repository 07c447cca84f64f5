"""Characters, the subspace of their expressions and what is known of how faces move."""
