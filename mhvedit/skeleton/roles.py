"""Which joint of the body each joint of a skeleton is, by the names that programs give them."""

import re
from collections.abc import Sequence
from typing import Final

from mhvedit.skeleton.tables import JOINT_NAMES

UNKNOWN: Final = ""
_MIDDLE: Final = ("pelvis", "spine", "neck", "head")
_SIDES: Final = ("left", "right")


def joint_roles(names: Sequence[str]) -> tuple[str, ...]:
    """The role of each joint ("left_hand", "spine"), or UNKNOWN.

    Programs disagree on what a shoulder is: with an arm below it, it is the clavicle, without one the upper arm.

    Args:
        names: J joints, parents first. A role goes to the first that claims it; spine is for all that do.
    """
    roles = [_role(name) for name in names]
    for side in _SIDES:
        if f"{side}_upper_arm" not in roles and f"{side}_clavicle" in roles:
            last = len(roles) - 1 - roles[::-1].index(f"{side}_clavicle")
            roles[last] = f"{side}_upper_arm"
    return tuple(role if role == "spine" or role not in roles[:joint] else UNKNOWN for joint, role in enumerate(roles))


def _role(name: str) -> str:
    """What one name says by itself."""
    plain = re.sub(r"[\s._\-]", "", name.rsplit(":", 1)[-1].lower())
    for role in _MIDDLE:
        if plain in JOINT_NAMES[role]:
            return role
    for side in _SIDES:
        for word in _without_side(plain, side):
            for role, words in JOINT_NAMES.items():
                if role not in _MIDDLE and word in words:
                    return f"{side}_{role}"
    return UNKNOWN


def _without_side(plain: str, side: str) -> list[str]:
    """What is left of a name if it is of this side: `leftarm`, `larm`, `armleft`, `arml`."""
    letter = side[0]
    return [
        rest
        for found, rest in (
            (plain.startswith(side), plain.removeprefix(side)),
            (plain.endswith(side), plain.removesuffix(side)),
            (plain.startswith(letter), plain[1:]),
            (plain.endswith(letter), plain[:-1]),
        )
        if found
    ]
