"""The viewer: a map in the browser, and the server that shows it."""
