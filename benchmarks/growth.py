"""How time and memory of the search grow with step, yaw step, voxel size, segment length and number of frames.

    python -m benchmarks.growth [--write]

One thing is changed at a time, on one piece of the bundled sword fight. Figures are kept beside those of
`benchmarks.paper_scale`; `--write` makes docs/performance.md of all of them.
"""

import argparse
import tempfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.duel import BUNDLED
from benchmarks.growth_tables import growth_section
from benchmarks.kept_figures import SLOWER, keep, kept
from benchmarks.performance_page import write_page
from benchmarks.process import measured
from benchmarks.search_case import WORKERS, SearchCase, keep_case
from mhvedit.pipeline.job import Job, load
from mhvedit.pipeline.people import Person, meet_people
from mhvedit.pipeline.terms import segment_clauses
from mhvedit.search.poses import pose_grid
from mhvedit.volumes.subject import SubjectVolumes, subject_volumes

FIRST = 130  # frame of both captures
SEGMENT = "04-blades-brush"  # whose type, parts and tolerances are used
WINDOW = 4.0  # m


@dataclass(frozen=True, slots=True)
class Setting:
    """What a search is asked."""

    step: int = 10  # mm
    yaw_step: int = 2  # degrees
    voxel: int = 10  # mm
    span: int = 16  # frames from the first to the last
    n_frames: int = 16  # of these, evenly spread

    @property
    def numbers(self) -> tuple[int, ...]:
        """(n_frames,) frame numbers."""
        return tuple(int(n) for n in np.rint(np.linspace(FIRST, FIRST + self.span - 1, self.n_frames)))


def axes() -> dict[str, dict[str, Setting]]:
    """All that is measured: by what is changed, and to what."""
    usual, coarse = Setting(), Setting(step=20)
    lengths, counts = (8, 16, 32, 64, 128), (8, 32, 128)
    return {
        "step": {f"{mm} mm": replace(usual, step=mm) for mm in (80, 40, 20, 10)},
        "yaw step": {f"{degrees}°": replace(usual, yaw_step=degrees) for degrees in (8, 4, 2, 1)},
        "voxel, at a step of 20 mm": {f"{mm} mm": replace(coarse, voxel=mm) for mm in (20, 10, 5)},
        "segment length": {f"{n} frames": replace(usual, span=n, n_frames=n) for n in lengths},
        "frames of the same motion": {f"{n} of 128": replace(usual, span=128, n_frames=n) for n in counts},
    }


def make_case(job: Job, people: Mapping[str, Person], setting: Setting, folder: Path) -> Path:
    """Keep a search for a process of its own."""
    spec = next(spec for spec in job.scene.segments if spec.name == SEGMENT)
    pitch = setting.voxel / 1000
    a, b = (_volumes(people[name], setting, spec.parts[name]) for name in spec.between)
    grid = pose_grid(
        a.body.centre[:2],
        b.body.centre[:2],
        pitch=pitch,
        stride=setting.step // setting.voxel,
        n_yaw=360 // setting.yaw_step,
        window=WINDOW,
    )
    clauses = segment_clauses(spec, a, b, pitch=pitch)
    name = "-".join(str(value) for value in asdict(setting).values())
    return keep_case(SearchCase(name, spec.interaction.value, setting.n_frames, grid, clauses, None), folder)


def _volumes(person: Person, setting: Setting, part: str) -> SubjectVolumes:
    return subject_volumes(
        person.sequence,
        person.subject.parts,
        numbers=setting.numbers,
        pose=person.pose,
        pitch=setting.voxel / 1000,
        wanted=frozenset({part}),
        workers=WORKERS,
    )


def measure(setting: Setting, job: Job, people: Mapping[str, Person]) -> dict[str, Any]:
    """Search with one setting, in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        return measured("measure_search", "run", make_case(job, people, setting, Path(folder))).figures


def main() -> None:
    """Measure everything, and print it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write docs/performance.md")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as cache:
        job = load(BUNDLED / "scene.toml", cache=Path(cache))
        people = meet_people(job.scene, job.subjects, job.store)
        chosen = {setting for settings in axes().values() for setting in settings.values()}
        found = {setting: measure(setting, job, people) for setting in chosen}
    rows = {
        axis: [{"value": value} | found[setting] for value, setting in settings.items()]
        for axis, settings in axes().items()
    }
    keep("growth", rows)
    print("\n".join(growth_section(kept())))
    if asked.write:
        write_page(kept(), kept(SLOWER), into_docs=True)


if __name__ == "__main__":
    main()
