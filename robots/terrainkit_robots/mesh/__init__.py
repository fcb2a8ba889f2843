"""Mesh files: what is in them, each opened only when something asks."""
