"""What a capture is: frames, rate, size, axes, and how sound its meshes are; with sentences about what looks wrong."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from mhvedit.geometry.arrays import FloatArray
from mhvedit.sequences.axes import METRES, to_metres_z_up
from mhvedit.sequences.glb_looks import glb_pictures
from mhvedit.sequences.guess import guess_units, guess_up, said_of_units, said_of_up
from mhvedit.sequences.meshes import Mesh
from mhvedit.sequences.obj import ObjMaterials, obj_materials
from mhvedit.sequences.quality import FrameQuality, measure_mesh
from mhvedit.sequences.raw import RawMesh
from mhvedit.sequences.read import ASSUMED_FPS, USD_SUFFIXES, load_raw, open_source
from mhvedit.sequences.sources import FrameSource
from mhvedit.sequences.usd import UsdSource

FAR_AWAY: Final = 1000.0  # m from the origin, from which on a capture is warned of
LOOKS: Final[Mapping[str, Callable[[Path], ObjMaterials]]] = {
    ".obj": obj_materials,
    ".glb": lambda path: ObjMaterials((), *glb_pictures(path)),
}
UNSEEN: Final = (*USD_SUFFIXES, ".ply")  # formats that can have pictures which are not looked for


@dataclass(frozen=True, slots=True)
class CaptureSummary:
    """A capture at a glance; sizes in metres and z up."""

    name: str
    path: Path
    kind: str  # how it is stored
    numbers: tuple[int, ...]  # frame numbers, ascending
    gaps: tuple[tuple[int, int], ...]  # first and last number of each run that is missing
    fps: float  # Hz
    fps_from: str  # given, capture or assumed
    units: str
    units_from: str  # given or guessed
    likely_units: str  # what the size speaks for
    up: str
    up_from: str  # given or guessed
    likely_up: str  # what the posture speaks for
    declared: str  # units and up axis that the file itself states; not applied
    frames: tuple[FrameQuality, ...]  # those that were measured, evenly spread
    connectivity_changes: bool  # between any two measured frames
    labels: tuple[int, ...]  # values of the vertex property `part`
    textures: tuple[Path, ...]  # material libraries and pictures
    textures_seen: bool  # False where the format can have some, and nobody looks
    missing_textures: tuple[Path, ...]  # named by the capture, but not there

    @property
    def bounds(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Lowest and highest coordinates over all measured frames."""
        low, high = _limits(self.frames)
        return tuple(low.min(0).tolist()), tuple(high.max(0).tolist())

    @property
    def middle(self) -> tuple[float, ...]:
        """The middle of the bounds."""
        return tuple((np.array(self.bounds[0]) + self.bounds[1]) / 2)

    @property
    def height(self) -> float:
        """Median extent along z."""
        low, high = _limits(self.frames)
        return float(np.median(high[:, 2] - low[:, 2]))

    @property
    def size(self) -> float:
        """Median of the longest extent along any axis."""
        low, high = _limits(self.frames)
        return float(np.median((high - low).max(1)))

    @property
    def watertight(self) -> int:
        """How many of the measured frames are watertight."""
        return sum(frame.watertight for frame in self.frames)


def inspect_capture(
    path: Path | str,
    *,
    name: str | None = None,
    fps: float | None = None,
    units: str | None = None,
    up: str | None = None,
    most: int = 48,
    cache: Path | None = None,
) -> CaptureSummary:
    """Look at a capture; what is not given is guessed, and the summary says so.

    Args:
        path: folder or file, as for `open_capture`.
        name: for the sentences; the file's name if None.
        fps: Hz, or None.
        units: m, cm or mm, or None to guess.
        up: x, y or z, or None to guess.
        most: measure at most that many frames, evenly spread, the first and the last among them.
        cache: folder for converted copies, or None.

    Raises:
        CaptureError: the capture, or a measured frame of it, cannot be used.
    """
    path = Path(path)
    source = open_source(path)
    picked = _spread(source.numbers, most)
    raws = [load_raw(number, source=source, cache=cache) for number in picked]
    low = np.array([raw.vertices.min(0) for raw in raws], np.float64)
    high = np.array([raw.vertices.max(0) for raw in raws], np.float64)
    likely_units = guess_units(low, high)
    metres = METRES[units or likely_units]
    likely_up = guess_up(low * metres, high * metres, read_as=up or "z")
    chosen_units, chosen_up = units or likely_units, up or likely_up
    looks = _materials(source, picked)
    return CaptureSummary(
        name=name or path.stem,
        path=path,
        kind=f"folder of {source.files[0].suffix.lower()} files"
        if path.is_dir()
        else f"one {path.suffix.lower()} file",
        numbers=source.numbers,
        gaps=_gaps(source.numbers),
        fps=float(fps or source.fps or ASSUMED_FPS),
        fps_from="given" if fps else "capture" if source.fps else "assumed",
        units=chosen_units,
        units_from="given" if units else "guessed",
        likely_units=likely_units,
        up=chosen_up,
        up_from="given" if up else "guessed",
        likely_up=likely_up,
        declared=_declared(source),
        frames=tuple(
            measure_mesh(Mesh(to_metres_z_up(raw.vertices, units=chosen_units, up=chosen_up), raw.faces), number)
            for number, raw in zip(picked, raws, strict=True)
        ),
        connectivity_changes=any(not np.array_equal(raw.faces, raws[0].faces) for raw in raws[1:]),
        labels=_labels(raws),
        textures_seen=source.files[0].suffix.lower() not in UNSEEN,
        textures=looks.libraries + looks.pictures,
        missing_textures=looks.missing,
    )


def _limits(frames: tuple[FrameQuality, ...]) -> tuple[FloatArray, FloatArray]:
    """(T, 3) lowest and highest coordinates of each measured frame."""
    return np.array([frame.low for frame in frames]), np.array([frame.high for frame in frames])


def _spread(numbers: tuple[int, ...], most: int) -> list[int]:
    """At most so many numbers, evenly spread, with both ends."""
    places = np.unique(np.linspace(0, len(numbers) - 1, min(max(most, 1), len(numbers))).round().astype(int))
    return [numbers[i] for i in places]


def _gaps(numbers: tuple[int, ...]) -> tuple[tuple[int, int], ...]:
    """First and last number of each run that is missing."""
    return tuple((a + 1, b - 1) for a, b in pairwise(numbers) if b - a > 1)


def _labels(raws: list[RawMesh]) -> tuple[int, ...]:
    """All label values."""
    return tuple(sorted({int(value) for raw in raws if raw.labels is not None for value in np.unique(raw.labels)}))


def _declared(source: FrameSource) -> str:
    """What a USD stage, or the glTF standard, says about units and up axis."""
    if isinstance(source, UsdSource):
        return f"{source.axes.metres_per_unit:g} m a unit, {source.axes.up} up"
    return "1 m a unit, y up" if source.files[0].suffix.lower() == ".glb" else ""


def _materials(source: FrameSource, picked: list[int]) -> ObjMaterials:
    """Materials of the measured frames of an OBJ or GLB capture."""
    look = LOOKS.get(source.files[0].suffix.lower())
    if look is None:
        return ObjMaterials((), (), ())
    wanted = set(picked)
    found = [look(f) for number, f in zip(source.numbers, source.files, strict=True) if number in wanted]
    merged = ([m.libraries for m in found], [m.pictures for m in found], [m.missing for m in found])
    return ObjMaterials(*(tuple(dict.fromkeys(file for files in group for file in files)) for group in merged))


def as_dict(summary: CaptureSummary) -> dict[str, object]:
    """The summary as JSON can hold it, with what is derived and the warnings."""
    plain = asdict(summary)
    plain["path"] = str(summary.path)
    plain["textures"] = [str(file) for file in summary.textures]
    plain["missing_textures"] = [str(file) for file in summary.missing_textures]
    for row, frame in zip(plain["frames"], summary.frames, strict=True):
        row["watertight"] = frame.watertight
    low, high = summary.bounds
    derived = {"low": low, "high": high, "height": summary.height, "watertight_frames": summary.watertight}
    return plain | derived | {"warnings": list(capture_warnings(summary))}


def as_text(summary: CaptureSummary) -> str:
    """The summary as a person reads it, warnings last."""
    s, low, high = summary, *summary.bounds
    rows = [
        ("frames", f"{len(s.numbers)}, numbers {s.numbers[0]} to {s.numbers[-1]}, {_gap_text(s.gaps)}"),
        ("rate", f"{s.fps:g} fps ({'as the capture says' if s.fps_from == 'capture' else s.fps_from})"),
        (
            "units, up",
            f"{s.units} ({s.units_from}), {s.up} up ({s.up_from})" + (s.declared and f"; file: {s.declared}"),
        ),
        ("bounds", " x ".join(f"{a:.3f} .. {b:.3f}" for a, b in zip(low, high, strict=True)) + " m"),
        ("height", f"{s.height:.3f} m (median)"),
        ("mesh", f"{_span(s, 'vertices')} vertices, {_span(s, 'faces')} faces, connectivity {_change(s)}"),
        ("watertight", f"{s.watertight} of {len(s.frames)} measured frames"),
        ("open edges", _span(s, "open_edges")),
        ("crowded edges", f"{_span(s, 'crowded_edges')} (more than two faces)"),
        ("flipped edges", f"{_span(s, 'flipped_edges')} (faces wound against each other)"),
        ("degenerate", f"{_span(s, 'degenerate_faces')} faces"),
        ("duplicates", f"{_span(s, 'duplicate_vertices')} vertices; in no face: {_span(s, 'loose_vertices')}"),
        ("pieces", _span(s, "pieces") + _bit_text(s)),
        ("labels", " ".join(map(str, s.labels)) or "none"),
        ("textures", ", ".join(file.name for file in s.textures) or ("none" if s.textures_seen else "not looked at")),
    ]
    body = "\n".join(f"  {key:<14}{value}" for key, value in rows)
    warnings = "".join(f"\n  ! {sentence}" for sentence in capture_warnings(s))
    return f"{s.name}: {s.kind}\n{body}{warnings}"


def _gap_text(gaps: tuple[tuple[int, int], ...]) -> str:
    """The missing runs, the first few."""
    if not gaps:
        return "no gaps"
    runs = [f"{a}" if a == b else f"{a}-{b}" for a, b in gaps]
    return "missing " + ", ".join(runs[:6]) + (f" and {len(runs) - 6} more runs" if len(runs) > 6 else "")


def _span(summary: CaptureSummary, field: str) -> str:
    """Smallest and largest value over the measured frames."""
    values = [int(getattr(frame, field)) for frame in summary.frames]
    return f"{min(values)}" if min(values) == max(values) else f"{min(values)} to {max(values)}"


def _change(summary: CaptureSummary) -> str:
    """Whether connectivity changes."""
    if len(summary.frames) == 1:
        return "of one frame"
    return "changes" if summary.connectivity_changes else "constant"


def _bit_text(summary: CaptureSummary) -> str:
    """The largest floating bit."""
    bits = [(faces, side, frame.number) for frame in summary.frames for faces, side in frame.bits]
    if not bits:
        return ""
    faces, side, number = max(bits)
    return f"; largest floating bit {faces} faces, {side * 100:.1f} cm, in frame {number}"


def capture_warnings(summary: CaptureSummary) -> tuple[str, ...]:
    """What looks wrong with a capture, in sentences that say what to do about it; most serious first."""
    s, said = summary, list(_place_warnings(summary))
    if s.gaps:
        said.append(f"frames {_gap_text(s.gaps)}")
    if s.fps_from == "assumed":
        said.append(f"{s.fps:g} fps is assumed: give fps")
    inside_out = [frame.number for frame in s.frames if frame.inside_out]
    if inside_out:
        said.append(f"inside out in {len(inside_out)} of {len(s.frames)} frames, first {inside_out[0]}")
    gaping = max(s.frames, key=lambda frame: frame.open_edges / frame.faces)
    if gaping.open_edges > 0.02 * gaping.faces:
        said.append(f"far from closed: {gaping.open_edges} open edges on {gaping.faces} faces in frame {gaping.number}")
    if s.missing_textures:
        said.append(f"{len(s.missing_textures)} texture files are missing, first {s.missing_textures[0]}")
    return tuple(f"{s.name}: {sentence}" for sentence in said)


def _place_warnings(summary: CaptureSummary) -> Iterator[str]:
    """What looks wrong with units, up axis and place."""
    s, (low, _) = summary, _limits(summary.frames)
    x, y, _ = s.middle
    away = float(np.hypot(x, y))
    if s.likely_units != s.units:
        yield said_of_units(s.height, s.size, likely=s.likely_units, how=f'units = "{s.likely_units}"')
        return
    if s.likely_up != s.up:
        yield said_of_up(s.height, likely=s.likely_up, how=f'up = "{s.likely_up}"')
    elif low[:, 2].min() > 0.1:
        yield f"stands {low[:, 2].min():.2g} m above the floor (z = 0) in every frame"
    elif low[:, 2].max() < -0.1:
        yield f"reaches {-low[:, 2].max():.2g} m below the floor (z = 0) in every frame"
    if away > FAR_AWAY:
        yield (
            f"lies {away / 1000:.3g} km from the origin, where most programs are coarse: "
            f"take ({round(x, -2):.0f}, {round(y, -2):.0f}) m off its x and y (z up)"
        )
