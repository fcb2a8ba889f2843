"""Validate, merge and repair inertias."""
