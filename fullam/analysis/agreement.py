"""Agreement of the paper's equations with their witness, as a table for one vehicle.

Three ways lead from a state and a rotor wrench to the platform's acceleration, to f_1, tau_1 and
to u_dc: the Newton-Euler recursion (10)-(13), the matrix system (21)-(25), and Pinocchio. Each
goes its way alone; only the state and the parameters are shared.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fullam.analysis.random_states import CATEGORIES, States, random_states, randomized_inertias
from fullam.checks import Checker
from fullam.dynamics import matrix_system, newton_euler
from fullam.dynamics.kinematics import link_acceleration, motion_of
from fullam.dynamics.multibody import Multibody, world_acceleration
from fullam.dynamics.rotations import turn
from fullam.exceptions import SettingsError
from fullam.model.chain import LinkChain
from fullam.model.vehicle import Vehicle

Array = NDArray[np.float64]

MODELS_DRAWN = 10
"""How many sets of random inertias the category "inertias" spreads its states over."""

CHUNK = 250
"""States whose matrices are assembled at once: 81 x 81 doubles each, 13 MB in all."""


@dataclass(frozen=True, eq=False)
class Answers:
    """What one witness says about N states; all in world axes, wrenches force then moment.

    Attributes:
        acceleration: [ddp_A, dw_A] of the origin of {A}, shape (N, 6).
        f: f_1..f_n, shape (N, n, 3) [N].
        tau: tau_1..tau_n, shape (N, n, 3) [N m].
        u_dc: Compensation, eq. (20), at the origin of {A}, shape (N, 6).
        condition: Condition numbers of the matrix system, shape (N,); empty for the others.
    """

    acceleration: Array
    f: Array
    tau: Array
    u_dc: Array
    condition: Array


@dataclass(frozen=True)
class AgreementRow:
    """Largest relative differences of one quantity between the three witnesses.

    Attributes:
        quantity: "acceleration", "f_1", "tau_1" or "u_dc".
        recursion_pinocchio: Newton-Euler recursion against Pinocchio.
        matrix_pinocchio: Matrix system against Pinocchio.
        recursion_matrix: Recursion against matrix system.
    """

    quantity: str
    recursion_pinocchio: float
    matrix_pinocchio: float
    recursion_matrix: float


MOST_SAMPLES = 10_000_000
"""Random states that are compared within an hour or so."""


@dataclass(frozen=True)
class AgreementTable:
    """Agreement of the witnesses for one vehicle.

    Attributes:
        vehicle: Name of the vehicle.
        samples: Number of random states.
        seed: Seed they were drawn from.
        unknowns: Size of the matrix system.
        condition_number: Largest condition number of its matrix.
        rows: One per quantity; no f_1 and tau_1 for a vehicle without an arm.
    """

    vehicle: str
    samples: int
    seed: int
    unknowns: int
    condition_number: float
    rows: tuple[AgreementRow, ...]

    @property
    def largest(self) -> float:
        """Largest relative difference in the table; infinite where one is no number.

        A comparison with NaN is false either way: as a difference it must not pass for agreement.
        """
        values = [
            (row.recursion_pinocchio, row.matrix_pinocchio, row.recursion_matrix)
            for row in self.rows
        ]
        largest = float(np.max(values, initial=0.0))
        return float("inf") if largest != largest or not values else largest

    def __str__(self) -> str:
        """The table as text, one quantity a line."""
        head = f"{'quantity':<14}{'recursion-Pin.':>16}{'matrix-Pin.':>16}{'recursion-matrix':>18}"
        lines = [
            f"{row.quantity:<14}{row.recursion_pinocchio:>16.1e}{row.matrix_pinocchio:>16.1e}"
            f"{row.recursion_matrix:>18.1e}"
            for row in self.rows
        ]
        foot = (
            f"largest relative differences over {self.samples} random states of '{self.vehicle}'"
            f" (seed {self.seed}); matrix of {self.unknowns} unknowns, condition number up to"
            f" {self.condition_number:.0f}"
        )
        return "\n".join([head, *lines, foot])


def recursion_and_matrix(chain: LinkChain, states: States) -> tuple[Answers, Answers]:
    """Answers of the Newton-Euler recursion and of the matrix system, in batches.

    Args:
        chain: Constants of the links, one set or one per state.
        states: The states.
    """
    motion = motion_of(chain, states.q, states.v)
    R_WA = motion.R[:, 0]
    wrench_W = np.hstack([turn(R_WA, states.wrench_A[:, :3]), turn(R_WA, states.wrench_A[:, 3:])])
    ddp_dw = newton_euler.base_acceleration(
        chain, motion, states.ddtheta, wrench_W, states.tool_wrench
    )
    full = link_acceleration(chain, motion, states.ddtheta, ddp_dw[:, 3:], ddp_dw[:, :3])
    f, tau = newton_euler.joint_wrenches(chain, motion, full, states.tool_wrench)
    u_dc = matrix_system.compensation(chain, motion, f[:, 0], tau[:, 0], states.tool_wrench)
    recursion = Answers(ddp_dw, f[:, :-1], tau[:, :-1], u_dc, np.empty(0))

    system = matrix_system.MatrixSystem(chain, (len(states.q),))
    system.assemble(motion, states.ddtheta, states.tool_wrench)
    solution = system.solve_wrench(wrench_W)
    f_1, tau_1 = (
        (solution.f[:, 0], solution.tau[:, 0]) if chain.n else np.split(states.tool_wrench, 2, 1)
    )
    u_dc = matrix_system.compensation(chain, motion, f_1, tau_1, states.tool_wrench)
    matrix = Answers(
        solution.acceleration_W, solution.f, solution.tau, u_dc, system.condition_number()
    )
    return recursion, matrix


def pinocchio_answers(witness: Multibody, states: States) -> Answers:
    """Answers of Pinocchio, state by state."""
    count, n = len(states.q), witness.n_arm
    acceleration, u_dc = np.empty((count, 6)), np.empty((count, 6))
    f, tau = np.empty((count, n, 3)), np.empty((count, n, 3))
    for k in range(count):
        q, v, tool_wrench = states.q[k], states.v[k], states.tool_wrench[k]
        a_A = witness.base_acceleration(q, v, states.ddtheta[k], states.wrench_A[k], tool_wrench)
        a = np.concatenate([a_A, states.ddtheta[k]])
        acceleration[k] = world_acceleration(q, v, a_A)
        f[k], tau[k] = witness.joint_wrenches(q, v, a, tool_wrench)
        u_dc[k] = witness.compensation(q, v, a, tool_wrench)
    return Answers(acceleration, f, tau, u_dc, np.empty(0))


def relative_difference(a: Array, b: Array) -> Array:
    """|a - b| / |b| in the 2-norm of the last axis; 0 where both vanish."""
    size = np.linalg.norm(b, axis=-1)
    return np.linalg.norm(a - b, axis=-1) / np.where(size > 0.0, size, 1.0)


def largest_differences(a: Answers, b: Answers) -> dict[str, float]:
    """Largest relative difference per quantity; f_1 and tau_1 only when there is an arm."""
    pairs = {"acceleration": (a.acceleration, b.acceleration), "u_dc": (a.u_dc, b.u_dc)}
    if a.f.shape[1]:
        pairs |= {"f_1": (a.f[:, 0], b.f[:, 0]), "tau_1": (a.tau[:, 0], b.tau[:, 0])}
    return {name: float(np.max(relative_difference(*pair))) for name, pair in pairs.items()}


def agreement(vehicle: Vehicle, samples: int = 1000, seed: int = 0) -> AgreementTable:
    """Compare the three witnesses on random states of every category.

    Args:
        vehicle: The vehicle.
        samples: Number of states, spread evenly over `CATEGORIES`; at least one of each.
        seed: Seed of the states.

    Returns:
        Largest relative differences in acceleration, f_1, tau_1 and u_dc.

    Raises:
        SettingsError: No vehicle, or a number of samples or a seed that is none.
        VehicleError: The paper's equations do not hold for the arm; names the joint.
    """
    check = Checker("agreement", SettingsError)
    check.instance("vehicle", vehicle, Vehicle)
    samples = check.whole("samples", samples, 1, MOST_SAMPLES)
    seed = check.whole("seed", seed)
    rng = np.random.default_rng(seed)
    largest: dict[str, Array] = {}
    drawn, condition = 0, 0.0
    for k, category in enumerate(CATEGORIES):
        count = max(1, samples // len(CATEGORIES) + (k < samples % len(CATEGORIES)))
        drawn += count
        parts = MODELS_DRAWN if category == "inertias" else 1 + count // CHUNK
        for part in np.array_split(np.arange(count), parts):
            if not part.size:
                continue
            model = vehicle.model
            if category == "inertias":
                model = randomized_inertias(model, rng)
            states = random_states(vehicle.n_arm, category, part.size, rng)
            chain = LinkChain.from_model(model, vehicle.tool)
            recursion, matrix = recursion_and_matrix(chain, states)
            witness = pinocchio_answers(Multibody(model, vehicle.tool), states)
            condition = max(condition, float(np.max(matrix.condition)))
            pairs = ((recursion, witness), (matrix, witness), (recursion, matrix))
            columns = [largest_differences(*pair) for pair in pairs]
            for name in columns[0]:
                found = np.array([column[name] for column in columns])
                largest[name] = np.maximum(largest.get(name, found), found)
    rows = tuple(
        AgreementRow(name, *(float(x) for x in largest[name]))
        for name in ("acceleration", "f_1", "tau_1", "u_dc")
        if name in largest
    )
    unknowns = matrix_system.SystemLayout(vehicle.n_arm).size
    return AgreementTable(vehicle.name, drawn, seed, unknowns, condition, rows)
