"""Expressions from films, measured on synthetic films of heads that are known."""
