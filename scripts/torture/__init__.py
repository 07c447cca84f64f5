"""Long trials of the whole program: hostile input, killed programs, hostile systems, long days."""
