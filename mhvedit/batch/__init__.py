"""Many scenes at once: what is asked, what it takes, who does it, what came of it."""
