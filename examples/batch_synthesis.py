"""Makes four variations of the bundled duel's demo, with two solutions each, on two worker processes.

    python examples/batch_synthesis.py      # writes out/batch; open out/batch/index.html

Run it again: nothing is left to do. Interrupt it and run it again: it goes on from there.
"""

from pathlib import Path

from mhvedit.batch.asked import asked_scenes
from mhvedit.batch.report import in_words
from mhvedit.batch.run import Options, run_batch
from mhvedit.batch.tasks import SceneDone
from mhvedit.pipeline.bundled import bundled_scene

TEMPLATE = """\
scene = "{scene}"
solutions = 2

[parameters]
"search.voxel" = [0.02]
"search.step" = [0.04]
"search.yaw_step" = [12]
"segments.02-cut-parried.visibility.half_angle" = [40, 60]
"optimise.facing_weight" = [0.5, 1.0]
"""


def main(out: Path = Path("out/batch"), scheduler: str | None = None) -> tuple[SceneDone, ...]:
    """Write a template and do what it asks for, on a cluster of its own or on that of a scheduler."""
    out.mkdir(parents=True, exist_ok=True)
    template = out / "many.toml"
    template.write_text(TEMPLATE.format(scene=bundled_scene("demo")))

    def told(done: SceneDone, finished: int, known: int) -> None:
        print(f"{finished} of {known}: {in_words(done)}")

    return run_batch(asked_scenes([template], out), out, options=Options(scheduler=scheduler, check=False), told=told)


if __name__ == "__main__":
    main()
