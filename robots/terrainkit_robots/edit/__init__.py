"""Edits: fixes, made in the text without touching the rest of it."""
