"""Maps: their configuration, generation, editing and validation."""
