"""Where several people meet each other and all poses that suit cost the same: those in which everybody keeps clear.

Two who act on each other are kept apart, or together, by their segments' own constraints. Everybody else who is on the
stage in the same frames is looked after here. It concerns groups of people of whom nobody can be come to in two ways
and each pair has poses that suit all its segments: there everybody keeps the own motion as a whole (see
`optimise.company`), so two people's relative placement is the same in all frames. People are placed one after the
other, each at the pose of most merit that keeps clear of those who stand already; where none does, the one before is
placed otherwise.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.geometry.planar import compose, invert
from mhvedit.optimise.graph import Pair, groups
from mhvedit.pipeline.assemble import by_pair, captured_poses, shared_rows
from mhvedit.pipeline.bodies import Body, Surroundings, frames_off_floor, met
from mhvedit.pipeline.people import Person
from mhvedit.pipeline.segments import SolvedSegment

COARSE: Final = 0.25, float(np.radians(30))  # m and rad: poses nearer than this are looked at later
MOST_POSES: Final = 1500  # of one pair that are looked at
MOST_TRIES: Final = 6000  # placements that are tried in one group


@dataclass(frozen=True, slots=True, eq=False)
class _Meeting:
    """A pair with all poses that suit it."""

    pair: Pair
    segments: tuple[int, ...]  # indices
    rows: tuple[IntArray, ...]  # (S,) of each segment's group
    poses: FloatArray  # (S, 3) of B's capture frame in A's
    order: IntArray  # (K,) in which to try them


def settled_rows(
    solved: Sequence[SolvedSegment],
    rows: Sequence[IntArray | None],
    *,
    people: Mapping[str, Person],
    bodies: Mapping[str, Body],
    around: Surroundings,
    pin: str | None,
) -> tuple[list[IntArray | None], tuple[str, ...]]:
    """Leave of each segment's solutions those in which everybody keeps clear.

    Args:
        solved: key segments, in order.
        rows: (N,) of each, the solutions to choose from; None for all.
        people: by name.
        bodies: by name.
        around: what the pinned person's group has to keep clear of; others are placed on the stage later.
        pin: who stands as captured, if anybody.

    Returns:
        Rows of each segment, None for all, and sentences where no placement was found.
    """
    left, said = list(rows), []
    pairs = [(solved[own[0]].spec.between, tuple(own)) for own in by_pair(solved)]
    links = ((i, j) for i, one in enumerate(pairs) for j, other in enumerate(pairs) if set(one[0]) & set(other[0]))
    for group in groups(len(pairs), links):
        names = tuple(dict.fromkeys(name for i in group for name in pairs[i][0]))
        pinned = pin if pin in names else None
        meetings = _meetings([pairs[i] for i in group], solved, left, people, pinned)
        if meetings is None or (len(meetings) == 1 and (pinned is None or around.empty)):
            continue
        found = _placed(meetings, bodies, around if pinned else None, pinned or names[0])
        if found is None:
            said.append(f"no placement was found in which {', '.join(names)} all keep clear of each other")
            continue
        for meeting, chosen in zip(meetings, found, strict=True):
            for i, own in zip(meeting.segments, meeting.rows, strict=True):
                left[i] = own[[chosen]]
    return left, tuple(said)


def _meetings(
    pairs: Sequence[tuple[Pair, tuple[int, ...]]],
    solved: Sequence[SolvedSegment],
    rows: Sequence[IntArray | None],
    people: Mapping[str, Person],
    pinned: str | None,
) -> list[_Meeting] | None:
    """A group's pairs, each with one person who is there already; None where not all can keep their motion."""
    known = {pinned or pairs[0][0][0]}
    left, found = list(pairs), []
    while left:
        pair, own = next(entry for entry in left if known & set(entry[0]))
        left.remove((pair, own))
        shared = shared_rows([solved[i] for i in own], [rows[i] for i in own])
        if shared is None or set(pair) <= known:
            return None
        known |= set(pair)
        merit = np.min([solved[i].merit(some) for i, some in zip(own, shared, strict=True)], axis=0)
        canonical = solved[own[0]].rows(shared[0]).poses
        poses = captured_poses(canonical, people[pair[0]], people[pair[1]])
        found.append(_Meeting(pair, own, tuple(shared), poses, _order(canonical, merit)))
    return found


def _order(poses: FloatArray, merit: FloatArray) -> IntArray:
    """Poses by merit, the best of every neighbourhood first; in canonical frames, or captures' frames would count."""
    by_merit = np.argsort(-merit, kind="stable")
    cells = np.floor(poses[by_merit] / np.array([COARSE[0], COARSE[0], COARSE[1]])).astype(np.int64)
    _, first = np.unique(cells, axis=0, return_index=True)
    leading = np.sort(first)
    others = np.setdiff1d(np.arange(len(poses)), leading)
    return np.asarray(by_merit[np.concatenate([leading, others])][:MOST_POSES])


def _placed(
    meetings: Sequence[_Meeting], bodies: Mapping[str, Body], around: Surroundings | None, first: str
) -> list[int] | None:
    """The pose of each pair; None where none was found."""
    at = {first: np.zeros(3)}
    chosen: list[int] = []
    trying: list[Iterator[int]] = [iter(meetings[0].order.tolist())]
    came: list[str] = []
    for _ in range(MOST_TRIES):
        meeting = meetings[len(trying) - 1]
        pose = next(trying[-1], None)
        if pose is None:
            trying.pop()
            if not trying:
                return None
            chosen.pop()
            del at[came.pop()]
            continue
        a, b = meeting.pair
        newcomer, partner = (b, a) if a in at else (a, b)
        relative = meeting.poses[pose] if newcomer == b else invert(meeting.poses[pose])
        place = compose(at[partner], relative)
        others = [(bodies[name], other) for name, other in at.items() if name != partner]
        if not _is_clear(bodies[newcomer], place, others, around):
            continue
        at[newcomer] = place
        chosen.append(pose)
        came.append(newcomer)
        if len(chosen) == len(meetings):
            return chosen
        trying.append(iter(meetings[len(trying)].order.tolist()))
    return None


def _is_clear(
    body: Body, place: FloatArray, others: Sequence[tuple[Body, FloatArray]], around: Surroundings | None
) -> bool:
    """Whether somebody who keeps the own motion at a place never touches others, a prop or the edge of the floor."""
    standing = np.tile(place, (len(body.rows), 1))
    for other, there in others:
        if met(body, other, standing, np.tile(there, (len(standing), 1)), first=True).any():
            return False
    if around is None:
        return True
    still = np.zeros_like(standing)
    if any(met(body, thing, standing, still, first=True).any() for thing in around.obstacles.values()):
        return False
    return next(frames_off_floor(body, standing, around.floor), None) is None
