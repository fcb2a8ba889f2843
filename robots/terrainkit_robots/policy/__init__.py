"""Evaluate, play, export and bundle trained policies."""
