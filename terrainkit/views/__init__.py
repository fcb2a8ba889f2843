"""Views: pictures, the viewer in the browser, and what a map costs."""
