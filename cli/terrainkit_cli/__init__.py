"""The `terrainkit` command: tyro reads its arguments, `render` alone prints."""
