"""Solves the whole bundled fight: nine key segments, 425 frames a person, 10 mm and 2 degrees; some minutes.

python examples/full_duel.py      # writes out/duel, with its report
"""

from pathlib import Path

from mhvedit import api
from mhvedit.pipeline.bundled import bundled_scene


def main(out: Path = Path("out/duel")) -> None:
    """Solve, check, and draw the report."""
    outcome = api.run_scene(bundled_scene("scene"), out)
    for segment in outcome.report["segments"]:
        print(f"{segment['name']:22} {segment['interaction']:5} {segment['solutions']:9,} placements")
    if not outcome.report["solved"]:
        print(outcome.report["failure"])
        return
    print(f"cost {outcome.report['cost']:.3g} m², gap {outcome.report['gap']:.2g} %")
    print(f"deepest penetration {outcome.report['check']['deepest_mm']:.1f} mm")
    print("\n".join(outcome.report["problems"]) or "nothing passes a threshold")


if __name__ == "__main__":
    main()
