"""The shared skinned motions; not part of the repository."""

from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "data" / "motions"
NAMES = tuple(sorted(path.stem for path in FOLDER.glob("*.npz")))


def shared_motion(name: str) -> Path:
    """The file of a motion; without the data the test is skipped."""
    path = FOLDER / f"{name}.npz"
    if not path.exists():
        pytest.skip("the shared motions are not here")
    return path
