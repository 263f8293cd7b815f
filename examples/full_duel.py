"""Solves the whole bundled fight: nine key segments, 425 frames a person, 10 mm and 2 degrees; some minutes.

python examples/full_duel.py      # writes out/duel, with its report
"""

from pathlib import Path

from mhvedit import api
from mhvedit.pipeline.bundled import bundled_scene


def main(out: Path = Path("out/duel"), scene: Path | None = None) -> None:
    """Solve, check, and draw the report."""
    outcome = api.run_scene(scene or bundled_scene("scene"), out, report=scene is None)
    for segment in outcome.result.segments:
        seconds = outcome.result.seconds[f"segment {segment.spec.name}"]
        print(f"{segment.spec.name:22} {segment.spec.interaction.value:5} {len(segment.group):9,} {seconds:5.1f} s")
    assembly = outcome.result.assembly
    if assembly is None or outcome.check is None:
        print(outcome.result.failure)
        return
    print(f"cost {assembly.scene.cost:.3g} m², gap {assembly.scene.gap:.2g} %")
    print(f"deepest penetration {outcome.check.deepest * 1000:.1f} mm")
    print("\n".join(outcome.problems) or "nothing passes a threshold")


if __name__ == "__main__":
    main()
