"""Left and right: the mirror, and what differs between its two sides."""
