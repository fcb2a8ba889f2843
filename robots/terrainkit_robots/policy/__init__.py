"""Evaluate, play, export and bundle trained policies, and smoke-test robots before training."""
