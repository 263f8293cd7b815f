"""What an editor decides about a segment, to and from the scene file."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from math import degrees, pi

from mhvedit.errors import SceneError
from mhvedit.pipeline.job import mirrored_spot
from mhvedit.project.changes import Place, Setting
from mhvedit.project.schema import Exclusion, SceneFile, SegmentSpec, Spot, Tolerance, Visibility


@dataclass(frozen=True, slots=True)
class Decision:
    """What the editor can change of one segment; told from the scene's side, as its `SegmentSpec`."""

    pin: Spot | None
    exclude: tuple[Exclusion, ...]
    half_angle: float | None  # rad, of the cones of sight; None: visibility is not asked for
    tolerance: Tolerance

    @property
    def searched(self) -> tuple[object, ...]:
        """What the search depends on; the rest only chooses among its solutions."""
        return (self.half_angle, self.tolerance)


Decisions = Mapping[str, Decision]  # by segment


def decisions_of(scene: SceneFile) -> dict[str, Decision]:
    """What a scene file says."""
    return {spec.name: _decision(spec) for spec in scene.segments}


def decided(scene: SceneFile, decisions: Decisions) -> SceneFile:
    """The scene as it is with other decisions."""
    return replace(scene, segments=tuple(_with(spec, decisions[spec.name]) for spec in scene.segments))


def changes_for(on_disk: SceneFile, told: SceneFile, decisions: Decisions) -> dict[Place, Setting]:
    """What to change in a scene file so that it says what was decided.

    Args:
        on_disk: the scene file, as `load_scene` reads it now.
        told: the scene that the decisions are about, from whose sides they are told.
        decisions: by segment.

    Raises:
        SceneError: a segment is no longer in the file.
    """
    specs = {spec.name: spec for spec in on_disk.segments}
    sides = {spec.name: spec.between for spec in told.segments}
    changes: dict[Place, Setting] = {}
    for name, decision in decisions.items():
        if name not in specs:
            raise SceneError(on_disk.file, "segments", f'the segment "{name}", which was there', ", ".join(specs))
        spec = specs[name]
        own = decision if spec.between == sides[name] else _mirrored(decision)
        changes |= {("segments", spec.index, *place): value for place, value in _differences(_decision(spec), own)}
    return changes


def _decision(spec: SegmentSpec) -> Decision:
    angle = None if spec.visibility is None else spec.visibility.half_angle
    return Decision(spec.pin, spec.exclude, angle, spec.tolerance)


def _with(spec: SegmentSpec, decision: Decision) -> SegmentSpec:
    frames = None if spec.visibility is None else spec.visibility.frames
    visibility = None if decision.half_angle is None else Visibility(decision.half_angle, frames)
    return replace(
        spec, pin=decision.pin, exclude=decision.exclude, visibility=visibility, tolerance=decision.tolerance
    )


def _mirrored(decision: Decision) -> Decision:
    """The same decision, told from the other side."""
    return replace(
        decision,
        pin=None if decision.pin is None else mirrored_spot(decision.pin),
        exclude=tuple(replace(e, at=mirrored_spot(e.at), of_a=not e.of_a) for e in decision.exclude),
    )


def _differences(before: Decision, after: Decision) -> Iterator[tuple[tuple[str, ...], Setting]]:
    """Places inside a segment's table, and what is to stand there."""
    pin = None if after.pin is None else _spot(after.pin)
    if pin != (None if before.pin is None else _spot(before.pin)):
        yield ("pin",), pin
    exclude: list[Setting] = [_exclusion(e) for e in after.exclude]
    if exclude != [_exclusion(e) for e in before.exclude]:
        yield ("exclude",), exclude or None
    if after.half_angle is None and before.half_angle is not None:
        yield ("visibility",), False
    elif after.half_angle is not None and after.half_angle != before.half_angle:
        yield ("visibility", "half_angle"), _neat(degrees(after.half_angle), 3)
    for field in fields(Tolerance):
        value = getattr(after.tolerance, field.name)
        if value != getattr(before.tolerance, field.name):
            yield ("tolerance", field.name), _neat(value, 6)


def _spot(spot: Spot) -> dict[str, Setting]:
    """To a tenth of a millimetre and a thousandth of a degree, which is far finer than any lattice."""
    return {"x": _neat(spot.x, 4), "y": _neat(spot.y, 4), "yaw": _neat(degrees(spot.yaw), 3)}


def _exclusion(exclusion: Exclusion) -> dict[str, Setting]:
    written = _spot(exclusion.at)
    if exclusion.radius is not None:
        written["radius"] = _neat(exclusion.radius, 4)
        if exclusion.turn < pi:
            written["turn"] = _neat(degrees(exclusion.turn), 3)
    return written


def _neat(value: float, digits: int) -> float:
    """A number as people write it; whole ones without a point."""
    rounded = round(value, digits)
    return int(rounded) if rounded == int(rounded) else rounded
