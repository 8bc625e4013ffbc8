"""The compensation u_dc of eq. (20), had in three ways that share nothing.

Each gives `chain(motions)`, the vehicle with its arm in motion as it wants to see it, and

    compensation(chain, R, w, acceleration, gravity)    u_dc at a wanted platform acceleration, (20)
    acceleration(chain, R, w, wrench, gravity)          platform acceleration under a wrench, (21)

with everything in world axes at the origin of {A}: R the attitude, w the angular velocity.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.dynamics.multibody import Multibody
from fullam.dynamics.paper_model import PaperModel
from fullam.dynamics.recursion import (
    Chain,
    JointMotion,
    compensation,
    place_joints,
    platform_acceleration,
)
from fullam.dynamics.spatial import Spatial, rotate_spatial, rotate_spatial_back
from fullam.exceptions import UnknownName
from fullam.model.vehicle import Vehicle
from fullam.numbers.records import flat, record
from fullam.numbers.vectors import rotate_back

Array = NDArray[np.float64]


class Recursion:
    """The recursion (6)-(13) as kernels: what machine code flies."""

    def __init__(self, vehicle: Vehicle, links: list[Any]) -> None:
        """Keep the links."""
        self._links = links
        self.compensation, self.acceleration = compensation, platform_acceleration

    def chain(self, motions: Sequence[JointMotion]) -> Chain:
        """Links, and joints placed."""
        joints: list[Any] = [None] * len(motions)
        place_joints(self._links, motions, joints)
        return Chain(self._links, joints)


class InMotion:
    """The vehicle in motion as Pinocchio's arrays q, v, a, for models that read those."""

    def __init__(self, vehicle: Vehicle, links: list[Any]) -> None:
        """Own a workspace."""
        self._links = links
        self._q, self._v = vehicle.neutral(), np.zeros(vehicle.model.nv)
        self._a = np.zeros(vehicle.model.nv)

    def chain(self, motions: Sequence[JointMotion]) -> Chain:
        """Links, and the motions as they are: who reads q places the joints itself."""
        return Chain(self._links, motions)

    def _look(self, chain: Chain, R: Any, w: Any) -> None:
        """Attitude, velocities and joint accelerations into Pinocchio's q, v, a."""
        self._q[3:7] = pin.Quaternion(np.array(R).reshape(3, 3)).coeffs()
        self._v[3:6] = rotate_back(R, w)
        for i, motion in enumerate(chain.joints):
            self._q[7 + i], self._v[6 + i], self._a[6 + i] = motion


class JointOne(InMotion):
    """u_dc read from Pinocchio's spatial force at arm joint 1.

    RNEA at (q, v, [a_A, ddtheta]) leaves the force of the platform on link 1 in `data.f`. Carried
    to {A} and joined by the platform's own weight and gyroscopic terms it is, at the origin of
    {A} and in its axes,

        u_dc = [f_1 - m_A g + m_A w x (w x c);
                tau_1 + r x f_1 + w x I_A w - m_A c x g]

    with the platform's mass m_A, centre of mass c and inertia I_A about the origin of {A}. For
    c = 0 this is eq. (20) with its erratum.

    Velocity invariance saves the conversion of accelerations: with the linear velocity of {A} set
    to zero (a frame moving along), spatial and classical acceleration are the same numbers.
    """

    def __init__(self, vehicle: Vehicle, links: list[Any]) -> None:
        """Own a workspace."""
        super().__init__(vehicle, links)
        self._model, self._data = vehicle.model, vehicle.create_data()
        self._multibody = Multibody(vehicle)
        self._platform = self._model.inertias[1]
        self._has_arm = self._model.njoints > 2

    def compensation(
        self, chain: Chain, R: Any, w: Any, acceleration: Spatial, gravity: float
    ) -> Spatial:
        """u_dc of eq. (20) at a wanted acceleration; see the module's first lines."""
        self._look(chain, R, w)
        self._a[:6] = flat(rotate_spatial_back(R, acceleration))
        pin.rnea(self._model, self._data, self._q, self._v, self._a)
        own, spin = self._platform, pin.Motion(np.zeros(3), self._v[3:6])
        down = pin.Motion(np.array(rotate_back(R, (0.0, 0.0, -gravity))), np.zeros(3))
        u_dc = spin.cross(own * spin) - own * down
        if self._has_arm:
            u_dc += self._data.liMi[2].act(self._data.f[2])  # f_1, tau_1 at the origin of {A}
        return rotate_spatial(R, record(Spatial, u_dc.vector))

    def acceleration(
        self, chain: Chain, R: Any, w: Any, wrench: Spatial, gravity: float
    ) -> Spatial:
        """Platform acceleration under a rotor wrench, eq. (21); see the module's first lines."""
        self._look(chain, R, w)
        u = np.array(flat(rotate_spatial_back(R, wrench)))
        a = self._multibody.base_acceleration(self._q, self._v, self._a[6:], u)
        return rotate_spatial(R, record(Spatial, a))


class NewtonEuler(InMotion):
    """The paper's matrix system (21)-(25), solved each time."""

    def __init__(self, vehicle: Vehicle, links: list[Any]) -> None:
        """Own the system."""
        super().__init__(vehicle, links)
        self._paper = PaperModel(vehicle)

    def compensation(
        self, chain: Chain, R: Any, w: Any, acceleration: Spatial, gravity: float
    ) -> Spatial:
        """u_dc of eq. (20) at a wanted acceleration; see the module's first lines."""
        self._look(chain, R, w)
        wanted = np.array(flat(acceleration))
        u_dc = self._paper.compensation(self._q, self._v, self._a[6:], acceleration_W=wanted)
        return record(Spatial, u_dc)

    def acceleration(
        self, chain: Chain, R: Any, w: Any, wrench: Spatial, gravity: float
    ) -> Spatial:
        """Platform acceleration under a rotor wrench, eq. (21); see the module's first lines."""
        self._look(chain, R, w)
        u = np.array(flat(wrench))
        solution = self._paper.solve(self._q, self._v, self._a[6:], wrench_W=u)
        return record(Spatial, solution.acceleration_W)


Model = JointOne | NewtonEuler | Recursion

MODELS: dict[str, type[Model]] = {
    "pinocchio": JointOne,
    "newton-euler": NewtonEuler,
    "recursion": Recursion,
}


def compensation_model(name: str, vehicle: Vehicle, links: list[Any]) -> Model:
    """The model of that name for a vehicle whose links as records are given.

    Raises:
        UnknownName: There is no such model.
    """
    if name not in MODELS:
        raise UnknownName("compensation model", name, MODELS)
    return MODELS[name](vehicle, links)
