"""The paper's model as an engine beside Pinocchio: the compensation from the matrix system."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics.kinematics import motion_of
from fullam.dynamics.matrix_system import MatrixSystem, SystemSolution, compensation
from fullam.exceptions import FullamError
from fullam.model.chain import LinkChain

if TYPE_CHECKING:
    from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]


class PaperModel:
    """Eqs. (20)-(25) for one vehicle, called with Pinocchio's q and v.

    Gives what `multibody.Multibody` gives, without Pinocchio: a controller can fly on either.

    Attributes:
        chain: Constants of the links.
        system: The matrix system, overwritten by each call.
    """

    def __init__(self, vehicle: Vehicle, released: str | None = None) -> None:
        """Read the vehicle's links.

        Args:
            vehicle: The vehicle.
            released: Fixed joint whose link counts as a link of its own, held at zero: the
                paper's fifth ("tool_joint" of the default vehicle gives its 81 unknowns).
        """
        self.chain = LinkChain.from_vehicle(vehicle, released)
        self.system = MatrixSystem(self.chain)
        # A fixed joint as last of the arm: its angle, rate and acceleration are zero.
        self._held = np.zeros(self.chain.n - vehicle.n_arm)

    def solve(
        self,
        q: Array,
        v: Array,
        ddtheta: Array,
        *,
        acceleration_W: Array | None = None,
        wrench_W: Array | None = None,
        tool_wrench: Array | None = None,
    ) -> SystemSolution:
        """X_s of eq. (21) for a wanted acceleration or for a given rotor wrench.

        Args:
            q: Configuration, shape (7 + n,).
            v: Velocity, body axes, shape (6 + n,).
            ddtheta: Joint accelerations, shape (n,) [rad/s^2 or m/s^2].
            acceleration_W: Wanted [ddp_A, dw_A], world axes, shape (6,): no algebraic loop.
            wrench_W: Rotor wrench, world axes at the origin of {A}, shape (6,), as the paper
                has it; give exactly one of the two.
            tool_wrench: Wrench on the environment, world axes at the tool, shape (6,).

        Raises:
            FullamError: Both or neither of acceleration and wrench were given.
        """
        motion = motion_of(
            self.chain, np.concatenate([q, self._held]), np.concatenate([v, self._held])
        )
        self.system.assemble(motion, np.concatenate([ddtheta, self._held]), tool_wrench)
        if acceleration_W is not None and wrench_W is None:
            return self.system.solve_acceleration(acceleration_W)
        if wrench_W is not None and acceleration_W is None:
            return self.system.solve_wrench(wrench_W)
        raise FullamError("solve: give either acceleration_W or wrench_W")

    def compensation(
        self,
        q: Array,
        v: Array,
        ddtheta: Array,
        *,
        acceleration_W: Array | None = None,
        wrench_W: Array | None = None,
        tool_wrench: Array | None = None,
    ) -> Array:
        """u_dc of eq. (20), world axes at the origin of {A}, force then moment, shape (6,).

        Arguments and errors as in `solve`.
        """
        solution = self.solve(
            q,
            v,
            ddtheta,
            acceleration_W=acceleration_W,
            wrench_W=wrench_W,
            tool_wrench=tool_wrench,
        )
        if self.chain.n:
            f_1, tau_1 = solution.f[0], solution.tau[0]
        else:
            end = np.zeros(6) if tool_wrench is None else tool_wrench
            f_1, tau_1 = end[:3], end[3:]
        return compensation(self.chain, self.system.motion, f_1, tau_1, tool_wrench)
