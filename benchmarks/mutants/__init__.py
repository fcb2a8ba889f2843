"""Mutants: copies of robots to which a defect is added; the defects are TOML data."""
