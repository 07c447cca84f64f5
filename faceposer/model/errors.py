"""Errors of data that cannot make a character."""


class InconsistentError(ValueError):
    """Raised for data that no character can have; the message names the first inconsistency and is fit for users."""
