"""Programs that some tests drive: where one is missing they are left out, but not in continuous integration."""

import os
import shutil

import pytest

APT = "apt-get install chromium xvfb"


def program(*names: str) -> str:
    """The path of a program, by any of its names."""
    found = next((path for name in names if (path := shutil.which(name))), None)
    if found is not None:
        return found
    sentence = f"{names[0]} is not installed; on Debian: {APT}"
    if os.environ.get("CI"):
        pytest.fail(sentence)
    pytest.skip(sentence)
