"""Rules on what is unlike published robots (NRM)."""
