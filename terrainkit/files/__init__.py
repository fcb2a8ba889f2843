"""Files: atomic writing, archives of arrays with limits, and the memory that is available."""
