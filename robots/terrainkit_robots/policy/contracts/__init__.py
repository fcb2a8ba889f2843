"""Contracts of policies: what a network of any project observes, and what its actions do."""
