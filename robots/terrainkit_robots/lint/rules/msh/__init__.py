"""Rules on mesh files (MSH)."""
