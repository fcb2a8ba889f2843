"""Hosts of tasks: one adapter for each framework whose environments are checked."""
