"""Rules on training tasks (TSK)."""
