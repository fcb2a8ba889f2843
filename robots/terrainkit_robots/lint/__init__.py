"""Check robots against rules."""
