"""The terrains, one noun a file. A new file here is a new terrain: nothing else lists them."""
