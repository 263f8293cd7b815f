"""Pictures that go along with an export: each once, under a name of its own."""

import hashlib
import re
from pathlib import Path

from mhvedit.sequences.looks import Picture


class PictureFolder:
    """Files of pictures beside an export; where several exports share a folder, names carry a hash of the content."""

    def __init__(self, folder: Path, *, shared: bool = False) -> None:
        self._folder, self._shared, self._names = folder, shared, dict[bytes, str]()

    def put(self, picture: Picture) -> str:
        """Write a picture, unless the same is there; returns the name of its file."""
        key = hashlib.blake2b(picture.data, digest_size=20).digest()
        if key not in self._names:
            self._folder.mkdir(parents=True, exist_ok=True)
            own = Path(picture.name)
            wanted = f"{own.stem}_{key.hex()[:12]}{own.suffix}" if self._shared else picture.name
            name = _free_name(wanted, set(self._names.values()))
            (self._folder / name).write_bytes(picture.data)
            self._names[key] = name
        return self._names[key]


def _free_name(wanted: str, taken: set[str]) -> str:
    """A name without anything that a format might trip over, and that no other file has."""
    plain = re.sub(r"[^A-Za-z0-9._-]", "_", wanted)
    stem, suffix, count = Path(plain).stem, Path(plain).suffix, 2
    while plain.lower() in {name.lower() for name in taken}:
        plain, count = f"{stem}_{count}{suffix}", count + 1
    return plain
