"""Everything that mhvedit raises for bad input; each is also the builtin a Python user would expect."""

from pathlib import Path


class MhveditError(Exception):
    """Base of all errors that bad input can cause; the message is one sentence that a user can act on."""


def counted(number: int, noun: str) -> str:
    """So many of something.

    >>> counted(1, "frame"), counted(2, "frame")
    ('1 frame', '2 frames')
    """
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


class ShapeError(MhveditError, ValueError):
    """An array has the wrong shape or type."""

    def __init__(self, name: str, got: object, expected: object) -> None:
        super().__init__(f"{name}: expected {expected}, found {got}")
        self.name, self.got, self.expected = name, got, expected


class CaptureError(MhveditError, ValueError):
    """A capture, or one frame of it, cannot be used."""

    def __init__(self, path: Path | str, expected: str, found: str) -> None:
        super().__init__(f"{path}: expected {expected}, found {found}")
        self.path, self.expected, self.found = Path(path), expected, found


class MissingFrame(MhveditError, KeyError):
    """A frame number that the capture does not have."""

    def __init__(self, subject: str, number: int, numbers: tuple[int, ...]) -> None:
        span = f"{numbers[0]} to {numbers[-1]}" if numbers else "no frames"
        super().__init__(f"{subject}: expected frame {number}, found {span} ({counted(len(numbers), 'frame')})")
        self.subject, self.number = subject, number

    def __str__(self) -> str:
        return str(self.args[0])


class SceneError(MhveditError, ValueError):
    """A scene file says something that cannot be: names the key, what was expected and what was there."""

    def __init__(self, path: Path | str, key: str, expected: str, found: str) -> None:
        super().__init__(f"{path}: {key}: expected {expected}, found {found}")
        self.path, self.key, self.expected, self.found = Path(path), key, expected, found


class MissingLibrary(MhveditError, ImportError):
    """An optional library, or a system library it needs, is not installed."""

    def __init__(self, wanted_for: str, install: str) -> None:
        super().__init__(f"{wanted_for} needs a library that is not installed: {install}")
        self.install = install


class NoScreen(MhveditError, RuntimeError):
    """There is no screen to open a window on."""

    def __init__(self, wanted_for: str, instead: str) -> None:
        super().__init__(f"{wanted_for}: expected a screen, found none: {instead}")
        self.instead = instead


class OutputBusy(MhveditError, RuntimeError):
    """Another run is writing to the same output folder."""

    def __init__(self, folder: Path | str, owner: str) -> None:
        super().__init__(f"{folder}: expected an output folder that no other run is using, found {owner}")
        self.folder = Path(folder)
