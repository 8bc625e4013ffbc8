"""What stands in the world of a scenario: planes, spheres and boxes that the tool may touch.

A surface pushes a point that is a depth delta inside it, by Hunt's and Crossley's law with Hertz's
exponent, and rubs by Coulomb's, regularised where the slip stops:

    f_n = k delta^(3/2) max(0, 1 + c ddelta),    f_t = -mu f_n v_t / sqrt(|v_t|^2 + s^2).

What a push gives back is never more than it took (c >= 0), and what rests creeps at the fraction of
s that its load asks for.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fullam.checks import Checker, from_zero, positive, shown, within
from fullam.dynamics.rotations import euler_rotation
from fullam.exceptions import ScenarioError, UnknownName

Array = NDArray[np.float64]

FAR = within(1e6, "m")


@dataclass(frozen=True, kw_only=True)
class Surface:
    """What every surface has.

    Attributes:
        stiffness: k [N/m^(3/2)]; 1e5 gives way by a millimetre under 3 N.
        dissipation: c [s/m]; what comes in slowly at v leaves with about 1 - 2 c v / 3 of it.
        friction: mu.
        slip: s, the speed below which friction is no longer full [m/s].
    """

    kind: ClassVar[str]
    stiffness: float = 1e5
    dissipation: float = 1.0
    friction: float = 0.5
    slip: float = 0.02

    def __post_init__(self) -> None:
        """Check the material's numbers."""
        check = Checker(f"world, {self.kind}", ScenarioError)
        for name, numbers in (
            ("stiffness", positive(1e9, "N/m^(3/2)")),
            ("dissipation", from_zero(1e3, "s/m")),
            ("friction", from_zero(10.0)),
            ("slip", positive(10.0, "m/s")),
        ):
            object.__setattr__(self, name, check.number(name, getattr(self, name), numbers))

    def _vector(self, name: str, numbers: Any = FAR) -> tuple[float, ...]:
        check = Checker(f"world, {self.kind}", ScenarioError)
        value = check.vector(name, getattr(self, name), 3, numbers)
        object.__setattr__(self, name, value)
        return value

    def to_dict(self) -> dict[str, Any]:
        """JSON values; `surface` is the inverse."""
        return {"kind": self.kind, **{f.name: getattr(self, f.name) for f in fields(self)}}


@dataclass(frozen=True)
class Plane(Surface):
    """All that is on the far side of a plane: a wall, the ground.

    Attributes:
        point: A point of it [m].
        normal: Out of it, of any length.
    """

    kind: ClassVar[str] = "plane"
    point: tuple[float, float, float]
    normal: tuple[float, float, float]

    def __post_init__(self) -> None:
        """Check the place."""
        super().__post_init__()
        self._vector("point")
        if not np.linalg.norm(self._vector("normal")) > 0.0:
            raise ScenarioError("world, plane", "normal", "is zero", "say which way is out")

    @property
    def unit_normal(self) -> Array:
        """The normal, of length 1."""
        return np.array(self.normal) / np.linalg.norm(self.normal)


@dataclass(frozen=True)
class Sphere(Surface):
    """A ball.

    Attributes:
        center: Its centre [m].
        radius: Its radius [m].
    """

    kind: ClassVar[str] = "sphere"
    center: tuple[float, float, float]
    radius: float

    def __post_init__(self) -> None:
        """Check the place."""
        super().__post_init__()
        self._vector("center")
        check = Checker("world, sphere", ScenarioError)
        radius = check.number("radius", self.radius, positive(1e4, "m"))
        object.__setattr__(self, "radius", radius)


@dataclass(frozen=True)
class Box(Surface):
    """A box. Inside it, the nearest side pushes.

    Attributes:
        center: Its centre [m].
        size: Its three edges [m].
        euler_deg: How it is turned, x-y-z Euler angles [deg].
    """

    kind: ClassVar[str] = "box"
    center: tuple[float, float, float]
    size: tuple[float, float, float]
    euler_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Check the place."""
        super().__post_init__()
        self._vector("center")
        self._vector("size", positive(1e4, "m"))
        self._vector("euler_deg", within(1e5, "deg"))

    @property
    def rotation(self) -> Array:
        """Its attitude in {W}, shape (3, 3)."""
        return euler_rotation(np.radians(self.euler_deg))


KINDS: dict[str, type[Surface]] = {c.kind: c for c in (Plane, Sphere, Box)}


def surface(data: Any) -> Surface:
    """A surface from {"kind": ..., fields}.

    Raises:
        UnknownName: No such kind.
        ScenarioError: A field that it does not have, or one that is missing.
    """
    values = Checker("world", ScenarioError).table("table", data)
    kind = values.pop("kind", "")
    if not isinstance(kind, str) or kind not in KINDS:
        raise UnknownName("kind of surface", kind if isinstance(kind, str) else shown(kind), KINDS)
    check = Checker(f"world, {kind}", ScenarioError)
    check.known(values, tuple(f.name for f in fields(KINDS[kind])))
    try:
        return KINDS[kind](**values)
    except TypeError as error:
        raise check.refuse("table", f"is incomplete: {error}", "give what is missing") from error
