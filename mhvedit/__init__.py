"""mhvedit: put people who were filmed apart into one scene."""

__version__ = "0.1.0"
