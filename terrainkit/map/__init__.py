"""Maps: their configuration, generation, import, editing and validation."""
