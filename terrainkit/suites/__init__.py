"""Suites: fixed maps on which policies are compared; docs/suites.md describes them."""

from terrainkit.suites.suite import Suite, generate_suite, get_suite, suite_hash, suite_names

__all__ = ["Suite", "generate_suite", "get_suite", "suite_hash", "suite_names"]
