"""Maximum a posteriori estimation of a face from constraints drawn on the screen (Lau et al. 2009, sections 4 to 6)."""
