"""Evaluation of posing techniques on unseen expressions (Lau et al. 2009, section 9)."""
