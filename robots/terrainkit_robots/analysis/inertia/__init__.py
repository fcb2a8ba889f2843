"""Validate, combine and repair inertias."""
