"""Where the bundled sword fight is: in the installed package, or beside it in a checkout."""

from pathlib import Path

from mhvedit.errors import CaptureError

PACKAGE = Path(__file__).resolve().parents[1]
PLACES = (PACKAGE / "data" / "duel", PACKAGE.parent / "data" / "duel")


def bundled_scene(name: str) -> Path:
    """The scene file of the bundled captures.

    Args:
        name: `scene` for the whole fight, `short` for three segments of it, `demo` for two.

    Raises:
        CaptureError: the captures were not installed.
    """
    for folder in PLACES:
        if (folder / f"{name}.toml").exists():
            return folder / f"{name}.toml"
    raise CaptureError(PLACES[0], "the bundled captures", "nothing: install mhvedit with its data")
