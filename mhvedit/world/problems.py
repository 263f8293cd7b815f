"""What cannot be simulated."""

from mhvedit.errors import MhveditError


class WorldError(MhveditError, ValueError):
    """A world, or something in it, cannot be: names it, what was expected and what was there."""

    def __init__(self, what: str, expected: str, found: object) -> None:
        super().__init__(f"{what}: expected {expected}, found {found}")
        self.what, self.expected, self.found = what, expected, found
