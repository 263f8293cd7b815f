"""Makes the pictures of README and docs from the bundled duel: `python docs/make_pictures.py [OUT]`.

OUT is an output folder of `mhvedit demo` (default out/demo); what it keeps between runs is used again.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from mhvedit import api
from mhvedit.geometry.arrays import ByteArray
from mhvedit.pipeline.bundled import bundled_scene
from mhvedit.pipeline.keys import segment_parts
from mhvedit.view.captions import captioned, webp_bytes
from mhvedit.view.placement import ShownBodies, placement_map
from mhvedit.view.renders import Colouring, frame_picture, scene_meshes, volume_picture
from mhvedit.view.story_pictures import scene_filmstrip
from mhvedit.view.studio import studio
from mhvedit.view.style import figure_picture
from mhvedit.volumes.parts import OwnMesh
from mhvedit.volumes.subject import part_of

PICTURES = Path(__file__).parent / "pictures"
SEGMENT = "02-cut-parried"
STRIP, STILL = (1280, 420), (620, 520)
WIDEST = 1600  # pixels


def main() -> None:
    """Solve the short duel and draw."""
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/demo")
    result = api.solve(api.load(bundled_scene("short"), cache=out / ".cache"))
    PICTURES.mkdir(exist_ok=True)
    save("duel", scene(result))
    save("volumes", volumes(result))
    save("placements", figure_picture(placements(result)))


def save(name: str, picture: ByteArray) -> None:
    """Write one picture, and say how large it is."""
    height, width = picture.shape[:2]
    shown = (min(width, WIDEST), round(height * min(width, WIDEST) / width))
    data = webp_bytes(np.asarray(Image.fromarray(picture).resize(shown, Image.Resampling.LANCZOS)), quality=86)
    (PICTURES / f"{name}.webp").write_bytes(data)
    print(f"{name}.webp {shown[0]} x {shown[1]}, {len(data) / 1000:.0f} kB")


def scene(result: api.Result) -> ByteArray:
    """The edited scene in a row of frames, and the moment in which the blades meet below it, seen nearer."""
    assert result.assembly is not None
    edit = result.assembly.scene
    captures = {name: person.sequence for name, person in result.people.items()}
    things = {
        name: [part.sequence for part in person.subject.parts.values() if isinstance(part, OwnMesh)]
        for name, person in result.people.items()
    }
    with studio(*STRIP) as plotter:
        strip = scene_filmstrip(edit, captures, 5, things=things, plotter=plotter)
    last = next(s.stop - 1 for s in edit.segments if s.name == SEGMENT)
    meshes = scene_meshes(edit, captures, last, things=things)
    with studio(strip.shape[1], 560) as plotter:
        still = frame_picture(meshes, plotter=plotter)
    return np.concatenate([captioned(still, "the cut is parried"), strip])


def volumes(result: api.Result) -> ByteArray:
    """Where the two blades pass, coloured by time and by label."""
    assert result.assembly is not None
    segment = result.segment(SEGMENT)
    sides = segment.volumes()
    names = segment_parts(segment.spec)
    parts = part_of(sides[0], names[0]), part_of(sides[1], names[1])
    row = result.assembly.chosen[result.segments.index(segment)]
    words = {Colouring.TIME: "coloured by time", Colouring.LABEL: "+ ending, - starting, 0 lateral"}
    with studio(*STILL) as plotter:
        pictures = [
            captioned(
                volume_picture(
                    parts,
                    segment.group.poses[row],
                    colouring=colouring,
                    bodies=(sides[0].body, sides[1].body),
                    plotter=plotter,
                ),
                text,
            )
            for colouring, text in words.items()
        ]
    return np.concatenate(pictures, axis=1)


def placements(result: api.Result) -> Figure:
    """Where Ben can stand beside Anna."""
    assert result.assembly is not None
    segment = result.segment(SEGMENT)
    sides = segment.volumes()
    return placement_map(
        segment.found,
        segment.group,
        result.assembly.chosen[result.segments.index(segment)],
        facing_a=segment.facing[0],
        facing_b=segment.facing[1],
        names=segment.spec.between,
        bodies=ShownBodies(sides[0].body, sides[1].body, segment.pair.n_frames - 1),
    )


if __name__ == "__main__":
    main()
