"""Measure what a task pays for, by known behaviors in its own step and reward functions."""
