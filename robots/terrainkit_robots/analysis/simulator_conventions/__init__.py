"""How each simulator orders joints and merges links."""
