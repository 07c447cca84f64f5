"""Heads, expressions, cameras and light from photos."""

#: Least and greatest weight of the density of heads, between which every head is one that could be: 1 for the most
#: probable head, less for likeness, more for likelihood.
LIKELIHOODS = (0.25, 4.0)
