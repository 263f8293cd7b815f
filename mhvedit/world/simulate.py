"""The loop over frames: driven bodies first, then simulated ones, then what still overlaps (Schmidl and Lin, C1.2)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np

from mhvedit.avoidance.posture import place
from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.world.advance import advanced
from mhvedit.world.bodies import FARTHEST, BodyClass, Pose
from mhvedit.world.coupling import coupled
from mhvedit.world.depth import TOLERANCE, PushedOut, overlaps, push_out
from mhvedit.world.motion import Moving
from mhvedit.world.narrow import Gaps, Narrow
from mhvedit.world.problems import WorldError
from mhvedit.world.resolve import Before, Resolved, ResolveSettings, resolve
from mhvedit.world.surroundings import Frames, Surroundings
from mhvedit.world.turning import turn_vector
from mhvedit.world.world import State, Tracked, World, all_colliders, centred

LONGEST: Final = 1.0  # s, of a frame


@dataclass(frozen=True, slots=True, eq=False)
class FrameReport:
    """What happened in a frame."""

    resolved: Resolved | None  # how the figure was freed
    deepest: float  # m, overlap that is left anywhere
    stuck: tuple[str, ...]  # what still overlaps, in words
    lost: tuple[str, ...]  # bodies that have left the world and are held at its end
    contacts: int  # points that carry something
    impacts: int  # how often simulated bodies were stopped on their way


class Simulation:
    """Steps a world; holds coal's shapes, so one for each thread."""

    def __init__(self, world: World, *, settings: ResolveSettings | None = None, seed: int = 0) -> None:
        self.world, self.settings, self.rng = world, settings, np.random.default_rng(seed)
        simulated, driven = world.of_kind(BodyClass.SIMULATED), world.of_kind(BodyClass.DRIVEN)
        n = len(world.bodies)
        own = np.arange(world.n_frames) >= n
        rigid = driven & ~own
        self._simulated, self._rigid = np.flatnonzero(simulated), np.flatnonzero(rigid)
        self._kept = np.flatnonzero(~simulated[:n])
        self._moved = np.flatnonzero(driven)
        self._dynamic = Narrow(all_colliders(world, simulated[:, None] | simulated[None]))
        self._still = Narrow(all_colliders(world, _either(rigid, ~simulated)))
        rigid_or_free = rigid | simulated
        self._all = Narrow(all_colliders(world, rigid_or_free[:, None] | rigid_or_free[None]))
        self._among_still, self._among_all = None, None
        if world.figure is not None:
            self._among_still = Surroundings(world.figure, [world.bodies[i] for i in self._kept])
            self._among_all = Surroundings(world.figure, world.bodies)

    def step(self, state: State, tracked: Tracked, time: float) -> tuple[State, FrameReport]:
        """One frame.

        Args:
            state: of the frame before.
            tracked: what the tracker says.
            time: s, of the frame.

        Raises:
            WorldError: a time step that is not above 0 or longer than 1 s, or tracked bodies that are not driven.
        """
        if not 0.0 < time <= LONGEST:
            raise WorldError("time step", f"above 0 and at most {LONGEST:g} s", time)
        self._check(tracked)
        state, resolved, moving = self._driven(state, tracked, time)
        gravity = np.array(self.world.gravity)
        done = advanced(self._dynamic, moving, self.world.meeting, gravity, time, carried=state.carried)
        moving, lost = self._held_inside(done.moving)
        state, resolved = self._cleared(replace(state, moving=moving, carried=done.carried), resolved)
        gaps = self._overlaps(state.moving)
        stuck = self._said(gaps)
        if resolved is not None and not resolved.free:
            stuck = (*stuck, f"figure: {resolved.reason}")
        deepest = max(gaps.deepest, resolved.deepest if resolved is not None else 0.0)
        return state, FrameReport(resolved, deepest, stuck, lost, len(done.carried.frames), done.impacts)

    # driven bodies

    def _driven(self, state: State, tracked: Tracked, time: float) -> tuple[State, Resolved | None, Moving]:
        """The state with driven bodies where they go, and, for what is pushed on the way, the rates that lead there."""
        before = state.moving
        rotations, positions = before.rotations.copy(), before.positions.copy()
        trackers, free = list(state.tracked), state.free.copy()
        for i in self._rigid.tolist():
            out, trackers[i] = self._rigid_moved(state, tracked, i, (rotations, positions), time)
            rotations[i], positions[i], free[i] = out.pose.rotation, out.pose.position, out.free
        state = replace(state, tracked=tuple(trackers), free=free)
        resolved = None
        if self._among_still is not None:
            appears = state.before is None
            frames = Frames(rotations[self._kept], positions[self._kept])
            state, resolved = self._figure_moved(state, tracked, self._among_still, frames)
            self._put_figure(resolved.q, rotations, positions)
            if appears:
                before = replace(before, **self._with_joints(before, rotations, positions))
        velocity, spin = before.velocity.copy(), before.spin.copy()
        velocity[self._moved] = (positions - before.positions)[self._moved] / time
        for i in self._moved.tolist():
            spin[i] = turn_vector(np.ascontiguousarray(rotations[i] @ before.rotations[i].T)) / time
        return state, resolved, replace(before, velocity=velocity, spin=spin)

    def _rigid_moved(
        self, state: State, tracked: Tracked, i: int, placed: tuple[FloatArray, FloatArray], time: float
    ) -> tuple[PushedOut, Pose]:
        """A driven body pulled to its tracker by its coupling and pushed out of what does not move (eqs 6 and 1)."""
        body, moving, last = self.world.bodies[i], state.moving, state.tracked[i]
        target = centred(body, tracked.poses[body.name]) if body.name in tracked.poses else last
        rate = (target.position - last.position) / time
        offset, _ = coupled(
            moving.positions[i] - last.position,
            moving.velocity[i] - rate,
            mass=body.mass,
            time=time,
            coupling=self.world.coupling,
        )
        free = Pose(moving.rotations[i], moving.positions[i]) if state.free[i] else None
        wanted = Pose(target.rotation, target.position + offset)
        return push_out(wanted, partial(overlaps, self._still, i, placed), free=free), target

    def _figure_moved(
        self, state: State, tracked: Tracked, among: Surroundings, frames: Frames
    ) -> tuple[State, Resolved]:
        """The figure near its tracked posture without overlap."""
        posture = tracked.posture
        if posture is None:
            if state.before is None:
                raise WorldError("first frame", "a tracked posture of the figure", "none")
            posture = state.before.tracked
        resolved = resolve(among, posture, frames, before=state.before, rng=self.rng, settings=self.settings)
        meant = posture if state.before is None or np.isfinite(posture).all() else state.before.tracked
        return replace(state, before=Before(resolved.q, meant, resolved.free)), resolved

    def _put_figure(self, q: FloatArray, rotations: FloatArray, positions: FloatArray) -> None:
        """Write the joints' frames behind those of the bodies."""
        assert self.world.figure is not None
        placed = place(self.world.figure.skeleton, q)
        n = len(self.world.bodies)
        rotations[n:], positions[n:] = placed.rotations, placed.positions

    # what still overlaps

    def _cleared(self, state: State, resolved: Resolved | None) -> tuple[State, Resolved | None]:
        """Driven bodies leave simulated ones that they overlap; where they cannot, these leave them (C1.3)."""
        if self._overlaps(state.moving).deepest <= TOLERANCE:
            return state, resolved
        rotations, positions = state.moving.rotations.copy(), state.moving.positions.copy()
        self._push_each(self._rigid, rotations, positions)
        if self._among_all is not None and state.before is not None:
            n = len(self.world.bodies)
            frames = Frames(rotations[:n], positions[:n])
            if self._among_all.look(state.before.q, frames, reach=0.0).gaps.deepest > TOLERANCE:
                again = Tracked(posture=state.before.tracked)
                other, found = self._figure_moved(state, again, self._among_all, frames)
                if found.free:
                    state, resolved = other, found
                    self._put_figure(found.q, rotations, positions)
        self._push_each(self._simulated, rotations, positions)
        return replace(state, moving=replace(state.moving, rotations=rotations, positions=positions)), resolved

    def _push_each(self, which: IntArray, rotations: FloatArray, positions: FloatArray) -> None:
        """Translate bodies out of everything, one after the other; writes to the arrays."""
        for i in which.tolist():
            look = partial(overlaps, self._all, i, (rotations, positions))
            out = push_out(Pose(rotations[i], positions[i]), look)
            if out.free:
                positions[i] = out.pose.position

    def _held_inside(self, moving: Moving) -> tuple[Moving, tuple[str, ...]]:
        """Bodies that have left the world stop at its end."""
        n = len(self.world.bodies)
        outside = np.flatnonzero(~(np.abs(moving.positions[:n]) < FARTHEST).all(1))
        if not len(outside):
            return moving, ()
        positions, velocity, momentum = moving.positions.copy(), moving.velocity.copy(), moving.momentum.copy()
        positions[outside] = np.clip(np.nan_to_num(positions[outside]), -FARTHEST, FARTHEST)
        velocity[outside], momentum[outside] = 0.0, 0.0
        held = replace(moving, positions=positions, velocity=velocity, momentum=momentum)
        return held, tuple(self.world.bodies[i].name for i in outside)

    def _overlaps(self, moving: Moving) -> Gaps:
        """Of all that is not certain to be free since the figure was resolved."""
        return self._all.near(moving.rotations, moving.positions, reach=0.0)

    def _said(self, gaps: Gaps) -> tuple[str, ...]:
        """Which frames overlap, in words."""
        names = [body.name for body in self.world.bodies]
        names += self.world.figure.skeleton.names if self.world.figure else ()
        deep = np.flatnonzero(gaps.distance < -TOLERANCE)
        carrier = self._all.colliders.carrier
        return tuple(
            f"{names[carrier[a]]} is {-1000 * depth:.1f} mm inside {names[carrier[b]]}"
            for (a, b), depth in zip(gaps.pairs[deep], gaps.distance[deep], strict=True)
        )

    def _check(self, tracked: Tracked) -> None:
        """Only driven bodies are tracked, and a posture needs a figure."""
        driven = [self.world.bodies[i].name for i in self._rigid]
        for name in tracked.poses:
            if name not in driven:
                raise WorldError("tracked body", f"one of the driven bodies ({', '.join(driven) or 'none'})", name)
        if tracked.posture is not None and self.world.figure is None:
            raise WorldError("tracked posture", "none, as the world has no figure", "one")

    @staticmethod
    def _with_joints(before: Moving, rotations: FloatArray, positions: FloatArray) -> dict[str, FloatArray]:
        """Bodies as they were and joints as they are: a figure that appears does not come from elsewhere."""
        joints = before.inverse_mass == 0
        return {
            "rotations": np.where(joints[:, None, None], rotations, before.rotations),
            "positions": np.where(joints[:, None], positions, before.positions),
        }


def run(
    simulation: Simulation, state: State, tracked: Sequence[Tracked], *, fps: float
) -> tuple[list[State], list[FrameReport]]:
    """All frames of a tracked motion.

    Args:
        simulation: of the world.
        state: before the first frame.
        tracked: for each frame.
        fps: frames a second.

    Returns:
        State and report of each frame.
    """
    states, reports = list[State](), list[FrameReport]()
    for each in tracked:
        state, report = simulation.step(state, each, 1.0 / fps)
        states.append(state)
        reports.append(report)
    return states, reports


def _either(one: BoolArray, other: BoolArray) -> BoolArray:
    """(F, F) pairs of which one is of the first kind and one of the second."""
    return (one[:, None] & other[None]) | (other[:, None] & one[None])
