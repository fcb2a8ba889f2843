"""Read XML documents with line numbers."""
