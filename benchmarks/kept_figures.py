"""Figures of all parts of the performance page, kept so that one part can be measured again without the others."""

import json
import os
import platform
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from benchmarks.process import run

DOCS = Path(__file__).resolve().parents[1] / "docs"
FILE = DOCS / "performance.json"
SLOWER = DOCS / "performance_slower.json"  # of a machine that is told of beside the first


def kept(file: Path = FILE) -> dict[str, Any]:
    """Figures by part."""
    if not file.exists():
        return {}
    found: dict[str, Any] = json.loads(file.read_text())
    return found


def keep(part: str, figures: dict[str, Any], file: Path = FILE) -> None:
    """Put the figures of one part in place of earlier ones, with the day and the machine they were measured on."""
    noted = {"measured": datetime.now(UTC).date().isoformat(), "machine": machine(), "speed": speed()}
    file.write_text(json.dumps(kept(file) | {part: figures | noted}, indent=1) + "\n")


def speed() -> float:
    """Seconds that `import numba` takes at the moment: a machine may be twice as fast an hour later."""
    return min(run(sys.executable, "-c", "import numba").seconds for _ in range(5))


def machine() -> str:
    """What kind of machine this is."""
    told = dict(line.split("\t", 1) for line in _lines("/proc/cpuinfo") if "\t" in line)
    names = [told[key].strip("\t: ") for key in ("model name", "cpu family") if key in told]
    total = [int(line.split()[1]) for line in _lines("/proc/meminfo") if line.startswith("MemTotal")]
    memory = f", {total[0] / 2**20:.0f} GB" if total else ""
    processor = ", family ".join(names) if names else platform.machine()
    return f"{os.cpu_count()} cores of {processor}{memory}, Python {platform.python_version()}"


def _lines(path: str) -> list[str]:
    return Path(path).read_text().splitlines() if Path(path).exists() else []
