"""The error of a fact that cannot be computed."""


class CannotCheckError(Exception):
    """A fact cannot be computed for this robot. The runner reports the reason, not a violation."""
