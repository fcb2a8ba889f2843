"""Inertias: which ones a body can have, and what to write instead of the others."""
