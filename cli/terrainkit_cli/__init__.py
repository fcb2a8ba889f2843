"""The `terrainkit` command. Only `render` prints."""
