"""Read and measure mesh files."""
