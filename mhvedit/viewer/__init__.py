"""The viewer: one state object, drawn in a window, in a browser, or into a file."""
