"""What a scene file says, in metres, radians and half-open frame ranges; nothing is opened yet."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from mhvedit.constraints.dictionary import InteractionType
from mhvedit.sequences.segments import Retiming


@dataclass(frozen=True, slots=True)
class FilePath:
    """A file or folder that a scene file names."""

    written: str  # as in the scene file
    path: Path  # absolute; relative ones are meant from the scene file's folder


@dataclass(frozen=True, slots=True)
class NearTrackSpec:
    """A part: what lies within a radius of a joint, or of the polyline through several."""

    track: FilePath
    joints: tuple[str, ...]  # one or more
    radius: float  # m, whatever the capture's units


@dataclass(frozen=True, slots=True)
class OwnMeshSpec:
    """A part: a mesh sequence of its own, in the units, up axis and numbering of the subject's."""

    path: FilePath


@dataclass(frozen=True, slots=True)
class InBoxSpec:
    """A part: what lies in a fixed box; metres, whatever the capture's units, along the capture's axes on disk."""

    centre: tuple[float, float, float]  # m
    size: tuple[float, float, float]  # m, whole edges


@dataclass(frozen=True, slots=True)
class WithLabelSpec:
    """A part: the vertices whose integer property `part` has this value."""

    label: int


@dataclass(frozen=True, slots=True)
class NearBonesSpec:
    """A part: what lies nearest to the named bones of the subject's skeleton."""

    bones: tuple[str, ...]  # one or more; a bone is named by the joint at its start


PartSpec = NearTrackSpec | OwnMeshSpec | InBoxSpec | WithLabelSpec | NearBonesSpec


@dataclass(frozen=True, slots=True)
class GazeSpec:
    """Track files of the eyes and of what they look at; may be one and the same file."""

    eye: FilePath
    target: FilePath


@dataclass(frozen=True, slots=True)
class EquipmentSpec:
    """A thing that hangs on a limb of a capture, in the units and axes of the subject's files."""

    path: FilePath  # a closed mesh
    limb: str  # joint of the fitted skeleton
    frame: int  # number of the captured frame in which the mesh is where it belongs


@dataclass(frozen=True, slots=True)
class SelfCollisionSpec:
    """`[subjects.<name>.self_collision]`: equipment or another girth, and limbs that are kept from what then meets."""

    method: str = "bisection"
    equipment: tuple[EquipmentSpec, ...] = ()
    girth: Mapping[str, float] = field(default_factory=dict)  # factors by joint of the fitted skeleton; others 1


@dataclass(frozen=True, slots=True)
class SubjectSpec:
    """One `[subjects.<name>]`."""

    file: Path  # the scene file, for error sentences
    key: str  # where it stands there, dotted
    name: str
    path: FilePath  # the capture
    frames: range | None  # use only these frame numbers of the capture; None: all
    fps: float | None  # Hz; None: what the capture says, or else 30
    units: str  # m, cm or mm
    up: str  # x, y or z
    facing: float | FilePath | None  # rad about up, 0 along the axis that becomes +x | a track file | None: estimate
    gaze: GazeSpec | None  # None: estimate
    skeleton: FilePath | None
    parts: Mapping[str, PartSpec]  # in the file's order; `body` is not among them
    self_collision: SelfCollisionSpec | None = None  # None: the capture stays as it is


@dataclass(frozen=True, slots=True)
class Visibility:
    """Each must stand in the other's cone of sight."""

    half_angle: float  # rad, above 0, at most pi
    frames: range | None  # to average over, counted from 0 in the retimed segment; None: all


@dataclass(frozen=True, slots=True)
class Tolerance:
    """How far a contact may miss, and bodies may sink in (`docs/scene-file.md`)."""

    frames: int = 0
    voxels: float = 0.0
    depth: float = 0.03  # m
    apart: float = 0.0  # m


@dataclass(frozen=True, slots=True)
class Spot:
    """Where B stands beside A: B's capture frame in A's, as `relative` in `edit.json`."""

    x: float  # m
    y: float  # m
    yaw: float  # rad


@dataclass(frozen=True, slots=True)
class Exclusion:
    """Solutions that the editor does not want: a connected region of them, or what is near a spot."""

    at: Spot
    radius: float | None  # m, from B's root there to B's root; None: the connected region that holds the spot
    turn: float = math.pi  # rad, how far B may be turned from the spot's yaw and still be left out
    of_a: bool = False  # whether the radius is between A's roots beside B instead: the segment is told from B's side


@dataclass(frozen=True, slots=True)
class SegmentSpec:
    """One `[[segments]]`: a pair of key segments."""

    index: int  # place in the file, from 0
    name: str
    between: tuple[str, str]  # A, B
    frames: Mapping[str, range]  # frame numbers of A and of B, before retiming
    interaction: InteractionType
    parts: Mapping[str, str]  # the interest part of A and of B; `body` where the file names none
    apart: tuple[tuple[str, str], ...] | None  # pairs of a part of A and one of B; (): "none"; None: "auto"
    visibility: Visibility | None
    retime: Retiming
    tolerance: Tolerance
    pin: Spot | None = None  # the solution that the editor insists on
    exclude: tuple[Exclusion, ...] = ()
    window: float | None = None  # m, in place of that of `[search]`

    @property
    def key(self) -> str:
        """Where it stands in the file."""
        return f'segments[{self.index}] "{self.name}"'


@dataclass(frozen=True, slots=True)
class SearchSettings:
    """`[search]`: the grid of candidate poses."""

    voxel: float = 0.01  # m
    step: float = 0.01  # m, whole multiple of voxel
    yaw_step: float = math.radians(2.0)  # rad, whole part of a full turn
    window: float = 4.0  # m, side of the square around A's root

    @property
    def stride(self) -> int:
        """Step in voxels."""
        return round(self.step / self.voxel)

    @property
    def n_yaw(self) -> int:
        """Samples of the full turn."""
        return round(math.tau / self.yaw_step)


@dataclass(frozen=True, slots=True)
class OptimiseSettings:
    """`[optimise]`: weights of the chain and of the paths."""

    facing_weight: float = 1.0  # lambda, m^2
    acceleration: float = 0.5  # delta, 0 .. 1
    alpha: float = 10.0  # per m a frame, and per rad a frame
    slow_speed: float = 0.01  # m a frame
    slow_turn: float = 0.01  # rad a frame


@dataclass(frozen=True, slots=True)
class Mark:
    """One `[[stage.marks]]`: somebody stands at a place of the stage in one captured frame."""

    key: str  # where it stands in the file
    subject: str
    frame: int  # number of the captured frame
    at: tuple[float, float]  # m, of the root in plan
    facing: float | None  # rad about up, 0 along x; None: any way
    within: float  # m, how near to the place suffices


@dataclass(frozen=True, slots=True)
class StageSpec:
    """`[stage]`: the floor that everybody stays on, marks, and who keeps the captured placement."""

    floor: tuple[tuple[float, float], ...] = ()  # m, corners of a polygon; none: no limits
    marks: tuple[Mark, ...] = ()
    pin: str | None = None  # a subject whose capture frame is the stage's


@dataclass(frozen=True, slots=True)
class MotionSpec:
    """How a prop was recorded to move: its frame is that of a joint of a BVH file."""

    path: FilePath
    joint: str | None  # None: the root
    units: str  # m, cm or mm
    up: str  # x, y or z


@dataclass(frozen=True, slots=True)
class PropSpec:
    """One `[props.<name>]`: a thing on the stage."""

    key: str  # where it stands in the file
    name: str
    path: FilePath  # a mesh file, or a capture
    units: str  # m, cm or mm
    up: str  # x, y or z
    kind: str  # `class` in the file: fixed, simulated or driven
    material: str  # wood, metal or human
    mass: float | None  # kg; None: of a solid of that material
    place: Spot  # of its own frame on the stage, or of its motion's
    motion: MotionSpec | None = None  # of a driven prop; None: as its capture
    stops: bool = True  # a fixed prop: whether limbs that reach into it stop at it


@dataclass(frozen=True, slots=True)
class SceneFile:
    """A whole scene file; see `load_scene`."""

    file: Path  # as it was given
    name: str
    fps: float | None  # Hz; the first subject's where the file has none; None where that has none either: `scene_fps`
    subjects: Mapping[str, SubjectSpec]  # in the file's order
    segments: tuple[SegmentSpec, ...]  # in the file's order, which is that in time of every subject
    search: SearchSettings = field(default_factory=SearchSettings)
    optimise: OptimiseSettings = field(default_factory=OptimiseSettings)
    stage: StageSpec = field(default_factory=StageSpec)
    props: Mapping[str, PropSpec] = field(default_factory=dict)  # in the file's order

    def window_of(self, segment: SegmentSpec) -> float:
        """Side of the square around A's root that a segment is searched in, m."""
        return self.search.window if segment.window is None else segment.window
