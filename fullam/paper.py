"""The paper as data: its symbols, its equations with their homes and tests, and its errata.

Ma Le, Wang Dong, Hao Zixu, Liu Jie, Sun Jiasen, Wang Siyu: "Design, Modeling and Dynamic
Compensation PID Control of a Fully-Actuated Aerial Manipulation System".
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Any

from fullam.exceptions import UnknownName
from fullam.paper_equations import ROWS
from fullam.paper_latex import LATEX


@dataclass(frozen=True)
class Symbol:
    """A symbol of the paper.

    Attributes:
        symbol: As the code and its docs write it.
        meaning: What it stands for.
        unit: SI unit and frame.
    """

    symbol: str
    meaning: str
    unit: str


@dataclass(frozen=True)
class Erratum:
    """A place where the printed text cannot be used as it stands.

    Attributes:
        where: Equation, table or section.
        equations: Numbers of the equations that it touches.
        printed: What is printed.
        used: What the code uses.
        why: The reason.
    """

    where: str
    equations: tuple[int, ...]
    printed: str
    used: str
    why: str


@dataclass(frozen=True)
class Equation:
    """One equation of the paper and its home in the code.

    Attributes:
        number: As printed.
        topic: A few words.
        statement: The equation with its errata applied.
        functions: Dotted names of what implements it; the first is its home.
        tests: "file::test" of what holds it.
    """

    number: int
    topic: str
    statement: str
    functions: tuple[str, ...]
    tests: tuple[str, ...]

    @property
    def latex(self) -> str:
        """The statement as LaTeX."""
        return LATEX[self.number - 1]

    def _repr_latex_(self) -> str:
        """What a notebook shows."""
        return rf"$\displaystyle {self.latex} \tag{{{self.number}}}$"

    @property
    def errata(self) -> tuple[Erratum, ...]:
        """The errata that touch this equation."""
        return tuple(erratum for erratum in ERRATA if self.number in erratum.equations)

    def resolve(self) -> tuple[Any, ...]:
        """The objects that `functions` names."""
        return tuple(_resolve(name) for name in self.functions)


def equation(number: int) -> Equation:
    """The equation of that number.

    Raises:
        UnknownName: The paper has no such equation.
    """
    try:
        return EQUATIONS[number]
    except KeyError:
        raise UnknownName("equation", str(number), map(str, EQUATIONS)) from None


def _resolve(name: str) -> Any:
    parts = name.split(".")
    # fullam.<room>.<module>, then attributes.
    target: Any = importlib.import_module(".".join(parts[:3]))
    for part in parts[3:]:
        target = getattr(target, part)
    return target


SYMBOLS = (
    Symbol("{W}", "inertial world frame, z up", ""),
    Symbol("{A}", "platform frame; in the paper its origin is the platform's centre of mass", ""),
    Symbol("{M_i}", "frame of arm joint i, z along the joint axis (Craig)", ""),
    Symbol("R_WA, p_WA", "attitude and position of {A} in {W}", "-, m"),
    Symbol("e_euler", "(phi, psi, gamma): R_WA = Rx(phi) Ry(psi) Rz(gamma), not rpy", "rad"),
    Symbol("alpha, a, d, theta", "Craig parameters of a joint", "rad, m, m, rad"),
    Symbol("w_i, dw_i", "angular velocity and acceleration of link i", "rad/s, rad/s^2, {W}"),
    Symbol("p_i, p_i^c", "origin of {M_i}; centre of mass of link i", "m, {W}"),
    Symbol("f_i, tau_i", "force, moment of link i-1 on link i, at {M_i}", "N, N m, {W}"),
    Symbol("f_{n+1}, tau_{n+1}", "force, moment of the end link on the environment", "N, N m, {W}"),
    Symbol("r_i^in", "p_i - p_i^c", "m, {W}"),
    Symbol("r_i^out", "p_{i+1} - p_i^c", "m, {W}"),
    Symbol("m_i, I_i", "mass; inertia about the centre of mass", "kg, kg m^2, {W}"),
    Symbol("G_i", "weight of link i, m_i g", "N, {W}"),
    Symbol("U_f, U_tau", "rotor force and moment on the platform", "N, N m, {W}"),
    Symbol("X_s", "unknowns of the linear system: 6 + 15 n scalars", "mixed, {W}"),
    Symbol("u_pid", "wanted acceleration of the PID", "m/s^2, rad/s^2, {W}"),
    Symbol("u_dc", "dynamic compensation, force then moment", "N, N m, {W}"),
    Symbol("e_tau, e_f", "attitude error theta_e v_e; position error p_d - p_c", "rad, m, {W}"),
    Symbol("Omega", "vector of SQUARED rotor speeds in (29)-(35); Omega_i is a speed", "(rad/s)^2"),
    Symbol("k_f, k_tau", "thrust, drag-torque coefficient", "N/(rad/s)^2, N m/(rad/s)^2"),
    Symbol("e_i^F, r_i, d_i", "thrust axis, hub position, spin of rotor i", "-, m, +-1; {A}"),
    Symbol("cant", "angle of the thrust axis with z_A (the paper's beta)", "rad"),
)

ERRATA = (
    Erratum(
        "(4)",
        (4,),
        "the distal (standard) Denavit-Hartenberg matrix",
        "Craig's: Rot_x(alpha) Trans_x(a) Trans_z(d) Rot_z(theta)",
        "the text says Craig and a constant P_i; the printed translation depends on theta",
    ),
    Erratum(
        "Table 1",
        (3, 4, 5),
        "lengths under alpha, angles under a",
        "the two columns exchanged",
        "units",
    ),
    Erratum(
        "Table 1, row 1",
        (5,),
        "{M_1} coincides with {A} at theta_1 = 0",
        "a constant mount Trans(0, 0, -0.06 m) Rot_z(45 deg) Rot_x(90 deg)",
        "the arm could never hang; the recorded static moments of the group fit this mount",
    ),
    Erratum("(5)", (5,), "^{k-1}T_k", "^{k-1}A_k of (3)", "naming slip"),
    Erratum(
        "(12), text",
        (12,),
        "G_A: weight of the aerial manipulator",
        "m_A g: of the platform alone",
        "f_1 carries the arm's weight; it would count twice",
    ),
    Erratum("(18), text", (18,), "parameters from R_A^d", "from R_A^e", "context"),
    Erratum(
        "(18)",
        (18,),
        "arccos of the trace, division by the sine",
        "a stable logarithm by way of the quaternion",
        "as printed NaN below 1e-8 rad, and wrong near pi",
    ),
    Erratum(
        "(20), force row",
        (20, 26),
        "G_A - f_1",
        "f_1 - G_A",
        "with the printed sign (26) in (12) doubles both terms instead of cancelling them",
    ),
    Erratum(
        "(20), order",
        (20,),
        "moment row first",
        "force first",
        "one order everywhere, as in e, (19), (22), (26), (34)",
    ),
    Erratum(
        "(20)-(22)",
        (20, 21, 22),
        "u_dc needs f_1, which needs U, which is u",
        "an explicit choice: put the wanted acceleration in the platform's rows, or solve with the "
        "wrench applied last",
        "an algebraic loop; the paper solves (21) with the U at hand",
    ),
    Erratum(
        "(23)",
        (23,),
        "right-hand sides g^2, g^2",
        "g^1 (centre of mass), g^2 (origin)",
        "(25)",
    ),
    Erratum(
        "(24)",
        (24,),
        "e_i(r_i^out x), I_{3x3n}, m^{m0}",
        "e_{i+1}(r_i^out x), I_{3x3}, m_i",
        "consistent with (13)",
    ),
    Erratum("(28), (33)", (28, 33), "k_tf, k_ct", "k_f, k_tau", "(27), (32)"),
    Erratum(
        "(34), text",
        (34,),
        "the matrices of [31], [32] are the general form",
        "they are special cases",
        "context",
    ),
    Erratum("(35)", (35,), "R_A times a 6-vector", "blkdiag(R_A, R_A)", "dimensions"),
    Erratum(
        "sections 2 and 6",
        (),
        "beta: angle of the rotor with the x-y plane, then of the thrust with {A}",
        "cant: angle of the thrust axis with z_A",
        "the two agree at 45 deg only",
    ),
)

EQUATIONS = {number: Equation(number, *row) for number, row in enumerate(ROWS, start=1)}
"""Equation by number, 1 to 35."""
