"""XML as it is written: documents, numbers, and what a reader could not make sense of."""
