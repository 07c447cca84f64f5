"""Characters, the subspace of their expressions, and the statistics of facial motion."""
