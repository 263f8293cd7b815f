"""Rigid bodies: what they are made of, how heavy they are, who moves them."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Final

import numpy as np

from mhvedit.geometry.arrays import FloatArray, Int32Array
from mhvedit.world.convex import convex_pieces
from mhvedit.world.materials import Materials
from mhvedit.world.pieces import MassProperties, Piece, mass_properties, mesh_mass, together
from mhvedit.world.problems import WorldError

FARTHEST: Final = 1e4  # m from the origin; beyond it distances are no longer exact


class BodyClass(StrEnum):
    """Who moves a body (Schmidl and Lin, preliminaries)."""

    FIXED = "fixed"
    SIMULATED = "simulated"
    DRIVEN = "driven"


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Where a body is: x_world = rotation @ x_body + position."""

    rotation: FloatArray  # (3, 3) world_from_body
    position: FloatArray  # (3,) m

    def __post_init__(self) -> None:
        if self.rotation.shape != (3, 3) or self.position.shape != (3,):
            raise WorldError(
                "pose", "a (3, 3) rotation and a (3,) position", (self.rotation.shape, self.position.shape)
            )
        if not (np.isfinite(self.rotation).all() and np.isfinite(self.position).all()):
            raise WorldError("pose", "finite numbers", "NaN or infinity")
        if not np.allclose(self.rotation @ self.rotation.T, np.eye(3), atol=1e-6) or np.linalg.det(self.rotation) < 0:
            raise WorldError("pose", "a rotation", self.rotation.tolist())
        if np.abs(self.position).max() > FARTHEST:
            raise WorldError("pose", f"a place within {FARTHEST:g} m of the origin", self.position.tolist())


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """A rigid body; its frame has the centre of mass as origin."""

    name: str
    pieces: tuple[Piece, ...]  # in the body's frame
    kind: BodyClass
    material: str
    mass: float  # kg; infinite for a fixed body
    inertia: FloatArray  # (3, 3) kg m2 about the centre of mass
    centre: FloatArray  # (3,) m, centre of mass in the frame in which the body was given

    def __post_init__(self) -> None:
        if not self.pieces:
            raise WorldError(self.name, "at least one convex piece", "none")
        if self.kind is BodyClass.FIXED:
            return
        if not 0.0 < self.mass < np.inf:
            raise WorldError(f"mass of {self.name}", "a number above 0 kg", self.mass)
        if np.linalg.eigvalsh(self.inertia)[0] <= 0:
            raise WorldError(f"inertia of {self.name}", "a positive definite matrix", self.inertia.tolist())


def body_of_pieces(
    name: str,
    pieces: Sequence[Piece],
    materials: Materials,
    *,
    kind: BodyClass,
    material: str,
    mass: float | None = None,
) -> Body:
    """A body of convex pieces that do not overlap much.

    Args:
        name: unique in its world.
        pieces: in any frame; the body's own has the same axes and the centre of mass as origin.
        materials: for the density.
        kind: who moves it.
        material: of the table.
        mass: kg; the material's density times the volume by default.

    Raises:
        WorldError: a mass that is not positive, an unknown material, no pieces.
    """
    if not pieces:
        raise WorldError(name, "at least one convex piece", "none")
    return _body(name, pieces, together([mass_properties(p) for p in pieces]), materials, (kind, material, mass))


def body_of_mesh(
    name: str,
    vertices: FloatArray,
    faces: Int32Array,
    materials: Materials,
    *,
    kind: BodyClass,
    material: str,
    mass: float | None = None,
    cache: Path | None = None,
) -> Body:
    """A body from a closed mesh, cut into convex pieces; mass properties are those of the mesh itself.

    Args:
        name: unique in its world.
        vertices: (V, 3) m.
        faces: (F, 3).
        materials: for the density.
        kind: who moves it.
        material: of the table.
        mass: kg; the material's density times the volume by default.
        cache: folder in which decompositions are kept.

    Raises:
        WorldError: the mesh is not closed or has no volume, a mass that is not positive, an unknown material.
    """
    pieces = convex_pieces(name, vertices, faces, cache=cache)
    return _body(name, pieces, mesh_mass(vertices, faces), materials, (kind, material, mass))


def _body(
    name: str,
    pieces: Sequence[Piece],
    solid: MassProperties,
    materials: Materials,
    given: tuple[BodyClass, str, float | None],
) -> Body:
    """A body whose frame is moved to its centre of mass."""
    kind, material, mass = given
    if material not in materials.density:
        raise WorldError(f"material of {name}", f"one of {', '.join(sorted(materials.density))}", material)
    heavy = materials.density[material] * solid.volume if mass is None else mass
    if not 0.0 < heavy < np.inf:
        raise WorldError(f"mass of {name}", "a number above 0 kg", heavy)
    moved = tuple(Piece(p.points - solid.centre, p.radius, p.faces) for p in pieces)
    if kind is BodyClass.FIXED:
        return Body(name, moved, kind, material, np.inf, np.full((3, 3), np.inf), solid.centre)
    return Body(name, moved, kind, material, heavy, solid.inertia * (heavy / solid.volume), solid.centre)
