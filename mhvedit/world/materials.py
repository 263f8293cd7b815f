"""What happens where two materials meet: restitution and friction (Schmidl and Lin, table 1)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from mhvedit.files import load_table
from mhvedit.world.problems import WorldError

PACKAGE: Final = "mhvedit.world"


@dataclass(frozen=True, slots=True)
class Surfaces:
    """How two materials meet."""

    restitution: float  # 0 (stays) to 1 (comes back as fast)
    friction: float  # Coulomb's coefficient

    def __post_init__(self) -> None:
        if not 0.0 <= self.restitution <= 1.0:
            raise WorldError("restitution", "a number from 0 to 1", self.restitution)
        if not 0.0 <= self.friction < float("inf"):
            raise WorldError("friction", "a number of at least 0", self.friction)


@dataclass(frozen=True, slots=True)
class Materials:
    """A table of materials."""

    density: Mapping[str, float]  # kg/m3, by name
    pairs: Mapping[frozenset[str], Surfaces]

    def __post_init__(self) -> None:
        for name, density in self.density.items():
            if not 0.0 < density < float("inf"):
                raise WorldError(f"density of {name}", "a number above 0", density)

    def between(self, a: str, b: str) -> Surfaces:
        """How two materials meet, in either order.

        Raises:
            WorldError: the table does not say.
        """
        found = self.pairs.get(frozenset((a, b)))
        if found is None:
            raise WorldError(f'materials "{a}" and "{b}"', f"a pair of {', '.join(sorted(self.density))}", "none")
        return found


def load_materials() -> Materials:
    """The table of the package: wood, human, metal."""
    return materials_of(load_table(PACKAGE, "materials"))


def materials_of(table: Mapping[str, Any]) -> Materials:
    """A table in the form of `data/materials.toml`."""
    pairs = {frozenset(row["between"]): Surfaces(row["restitution"], row["friction"]) for row in table["pairs"]}
    return Materials(dict(table["density"]), pairs)
