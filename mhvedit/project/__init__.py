"""The scene file: checked on loading, written back with its comments."""
