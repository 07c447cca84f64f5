"""How near methods come to expressions that they have never seen (Lau et al. 2009, section 9)."""
