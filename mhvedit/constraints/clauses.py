"""What a constraint is to the search: pairs of volumes that must, or must never, meet.

A *meeting* holds at a pose if the two volumes share a voxel in which they also share a bit (a frame, or another moment
that the bits stand for). A *clause* holds if one of its options does; an option holds if all that must meet do, and
nothing that must never meet does. A pose is accepted if all clauses hold; the first that does not is the reason for
its rejection.
"""

from dataclasses import dataclass

from mhvedit.geometry.arrays import Words
from mhvedit.volumes.history import Volume, is_empty


@dataclass(frozen=True, slots=True, eq=False)
class Meeting:
    """Two volumes with bits on one time line; `every` asks for all of these bits, not just for any."""

    a: Volume
    b: Volume
    every: Words | None = None  # (W,)

    @property
    def possible(self) -> bool:
        """Whether both hold anything."""
        return not (is_empty(self.a) or is_empty(self.b))


@dataclass(frozen=True, slots=True, eq=False)
class Option:
    """One way in which a clause can hold."""

    must: tuple[Meeting, ...] = ()
    never: tuple[Meeting, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Clause:
    """A constraint, and what to tell the editor of poses that it rejects."""

    reason: str
    options: tuple[Option, ...]
