"""Derive the spec of a robot from its facts."""
