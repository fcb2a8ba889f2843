"""Rules on units: one quantity that is off by the same factor everywhere (UNI)."""
