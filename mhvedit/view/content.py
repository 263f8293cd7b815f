"""What a report is told: plain data, so that the pipeline, tests and notebooks can all fill it in."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from mhvedit.geometry.arrays import FloatArray
from mhvedit.scene.edit import EditedScene
from mhvedit.scene.eyes import Eyes
from mhvedit.search.groups import SolutionGroup
from mhvedit.search.solve import ReasonMap
from mhvedit.sequences.meshes import MeshSequence
from mhvedit.view.charts import SceneCheck
from mhvedit.view.placement import MapSummary
from mhvedit.view.skeletons import FittedStory
from mhvedit.volumes.history import MotionHistoryVolume


@dataclass(frozen=True, slots=True, eq=False)
class StorySide:
    """One of the two people of a key segment."""

    subject: str
    part: str
    frames: tuple[int, int]  # inclusive, numbers as in the file names
    facing: float = 0.0  # rad, over the segment, in the subject's canonical frame
    part_volume: MotionHistoryVolume | None = None  # canonical frame
    body_volume: MotionHistoryVolume | None = None  # canonical frame


@dataclass(frozen=True, slots=True, eq=False)
class SegmentStory:
    """One key segment: what was asked, what was found, what was chosen."""

    name: str  # as in `EditedScene.segments`, if it is there
    interaction: str
    a: StorySide
    b: StorySide
    n_frames: int  # tau
    found: ReasonMap | MapSummary | None = None
    group: SolutionGroup | None = None
    chosen: int | None = None  # row of the group
    asked: Sequence[str] = ()  # more of what was asked, in words: tolerances, visibility, a pin
    half_angle: float | None = None  # of the cones of sight, rad
    killed_by: str = ""  # for an empty group: the constraint that kills it, in words
    nearest: str = ""  # for an empty group: how far the nearest pose is from passing, in words
    figures: Mapping[str, str] = field(default_factory=dict)  # more numbers: name -> value with its unit
    notes: Sequence[str] = ()


@dataclass(frozen=True, slots=True, eq=False)
class CaptureStory:
    """What is known of one capture."""

    name: str
    facts: Mapping[str, str] = field(default_factory=dict)  # frames, faces, height: name -> value with its unit
    facing: str = ""  # where the facing comes from, in words
    facing_trust: float | None = None  # 0 .. 1
    gaze: str = ""  # where the gaze comes from, in words
    notes: Sequence[str] = ()
    fitted: FittedStory | None = None  # where a skeleton was fitted and the capture repaired


@dataclass(frozen=True, slots=True, eq=False)
class ReportContent:
    """All that a report shows."""

    name: str
    stories: Sequence[SegmentStory]
    scene: EditedScene | None = None  # None where nothing could be placed
    captures: Mapping[str, MeshSequence] = field(default_factory=dict)  # by subject, and by prop
    things: Mapping[str, Sequence[MeshSequence]] = field(default_factory=dict)  # by subject: own meshes, as swords
    eyes: Mapping[str, Eyes] = field(default_factory=dict)  # by subject
    check: SceneCheck | None = None
    limit_mm: float | None = None  # how deep bodies may sink into each other
    centres: Mapping[str, FloatArray] = field(default_factory=dict)  # by subject: (N, 2) m, see `trajectories`
    passed: bool | None = None  # None: all segments placed
    about: Sequence[CaptureStory] = ()
    warnings: Sequence[str] = ()
    notes: Sequence[str] = ()
    settings: Mapping[str, str] = field(default_factory=dict)
    stage_seconds: Mapping[str, float] = field(default_factory=dict)
