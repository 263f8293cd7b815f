"""The Python interface: load a scene, solve it, look at solution groups, pick, write.

Five lines do it all::

  from mhvedit import api
  result = api.solve(api.load("scene.toml"))
  group = result.segment("04-slap").group
  result = api.choose(result, {"04-slap": int(group.clearance.argmax())})
  api.write(result, "out")

After a change of the scene file, `api.solve(api.load("scene.toml"), previous=result)` makes only what that changed.
"""

from pathlib import Path

from mhvedit.pipeline.job import Job, Result, choose, load, solve
from mhvedit.pipeline.output import claimed, write_result
from mhvedit.pipeline.run import Outcome, check_output, run_scene
from mhvedit.scene.edit import EditedScene, placed_mesh, placed_prop, read_edit

__all__ = [
    "EditedScene",
    "Job",
    "Outcome",
    "Result",
    "check_output",
    "choose",
    "load",
    "placed_mesh",
    "placed_prop",
    "read_edit",
    "run_scene",
    "solve",
    "write",
]


def write(result: Result, out: Path | str) -> None:
    """Write `edit.json` and the solution groups.

    Args:
        result: of `solve` or `choose`.
        out: output folder.

    Raises:
        OutputBusy: another run is writing there.
    """
    with claimed(Path(out)):
        write_result(Path(out), result)
