"""Show robots and policies in the browser, with viser."""
