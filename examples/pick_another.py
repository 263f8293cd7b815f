"""Solves the short duel on a coarse grid, picks another solution than the chosen one, and writes both.

python examples/pick_another.py      # writes out/chosen and out/picked
"""

import math
from dataclasses import replace
from pathlib import Path

from mhvedit import api
from mhvedit.pipeline.bundled import bundled_scene
from mhvedit.project.schema import SearchSettings

SEGMENT = "04-blades-brush"
COARSE = SearchSettings(voxel=0.02, step=0.04, yaw_step=math.radians(12))


def main(out: Path = Path("out")) -> None:
    """Load, solve, look, pick, write."""
    job = api.load(bundled_scene("short"))
    result = api.solve(replace(job, scene=replace(job.scene, search=COARSE)))
    group = result.segment(SEGMENT).group
    picked = api.choose(result, {SEGMENT: int(group.distance.argmax())})  # as far apart as they can be
    for name, one in (("chosen", result), ("picked", picked)):
        api.write(one, out / name)
        if one.assembly is None:
            print(f"{name}: {one.failure}")
        else:
            scene = one.assembly.scene
            print(f"{name}: {scene.segments[-1].distance:.2f} m apart, cost {scene.cost:.3g} m²")


if __name__ == "__main__":
    main()
