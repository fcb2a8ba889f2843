"""legged_gym's own terrain imports this module."""
