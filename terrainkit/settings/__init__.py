"""Settings: typed dataclasses that read and write TOML, and the texts of their errors."""
