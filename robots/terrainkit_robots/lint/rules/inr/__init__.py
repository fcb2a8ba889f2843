"""Rules on masses and inertias (INR)."""
