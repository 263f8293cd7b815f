"""How a long job tells how far it is."""

from collections.abc import Callable

Progress = Callable[[str, float], None]  # stage in words, share of it that is done


def silent(stage: str, share: float) -> None:
    """Tell nobody."""
    del stage, share
