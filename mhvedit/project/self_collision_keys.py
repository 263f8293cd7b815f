"""The `[subjects.<name>.self_collision]` table of a scene file."""

from collections.abc import Mapping
from typing import Any, Final

from mhvedit.fitting.joints import NAMES
from mhvedit.project.schema import EquipmentSpec, SelfCollisionSpec
from mhvedit.project.values import Value, fields, file_path, number, one_of, table, whole

METHODS: Final = ("bisection", "filter")
SIDED: Final = tuple(name.removeprefix("left_") for name in NAMES if name.startswith("left_"))
KEYS: Final[Mapping[str, Any]] = {"method": "bisection", "equipment": [], "girth": {}}
LEAST_GIRTH: Final = 0.5
LARGEST_GIRTH: Final = 2.0


def self_collision(at: Value) -> SelfCollisionSpec:
    """The table, checked.

    Args:
        at: the table.

    Raises:
        SceneError: naming the key, what was expected and what is there.
    """
    entries = fields(at, KEYS)
    listed = entries["equipment"]
    if not isinstance(listed.value, list):
        raise listed.error("a list of {path = FILE, limb = LIMB, frame = NUMBER}")
    return SelfCollisionSpec(
        method=one_of(entries["method"], METHODS),
        equipment=tuple(_equipment(listed.at(i, value)) for i, value in enumerate(listed.value)),
        girth=_girth(entries["girth"]),
    )


def _equipment(at: Value) -> EquipmentSpec:
    """One thing on one limb."""
    entries = fields(at, dict.fromkeys(("path", "limb", "frame")))
    return EquipmentSpec(
        file_path(entries["path"], "a mesh file"), one_of(entries["limb"], NAMES), whole(entries["frame"])
    )


def _girth(at: Value) -> Mapping[str, float]:
    """One factor for the whole body, or factors by limb; `upper_arm` stands for both."""
    if not isinstance(at.value, dict):
        return dict.fromkeys(NAMES, number(at, least=LEAST_GIRTH, most=LARGEST_GIRTH))
    factors: dict[str, float] = {}
    for key, value in table(at).items():
        entry = at.at(key, value)
        one_of(at.at(key, key), (*NAMES, *SIDED))
        limbs = [f"{side}_{key}" for side in ("left", "right")] if key in SIDED else [key]
        factors |= dict.fromkeys(limbs, number(entry, least=LEAST_GIRTH, most=LARGEST_GIRTH))
    return factors
