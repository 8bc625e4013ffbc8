"""Rows of `fullam.paper.EQUATIONS`, in the paper's order: topic, statement, functions, tests."""

from __future__ import annotations

Row = tuple[str, str, tuple[str, ...], tuple[str, ...]]

ROWS: tuple[Row, ...] = (
    (
        "pose of the platform",
        "T_WA = [[R_WA, p_WA], [0, 1]]",
        ("fullam.dynamics.kinematics.platform_pose",),
        ("tests/dynamics/test_kinematics.py::test_platform_pose_1_maps_body_points_to_world",),
    ),
    (
        "Euler angles",
        "R_WA = Rx(phi) Ry(psi) Rz(gamma)",
        (
            "fullam.dynamics.rotations.euler_rotation",
            "fullam.dynamics.rotations.euler_angles",
        ),
        ("tests/dynamics/test_rotations.py::test_euler_2_is_intrinsic_xyz_and_not_roll_pitch_yaw",),
    ),
    (
        "transform between joints",
        "^{i-1}A_i = [[^{i-1}R_i, ^{i-1}P_i], [0, 1]]",
        (
            "fullam.model.craig.homogeneous",
            "fullam.model.craig.CraigRow.transform",
        ),
        ("tests/model/test_craig.py::test_urdf_joint_placements_are_the_craig_rows",),
    ),
    (
        "Craig parameters",
        "^{i-1}A_i = Rot_x(alpha) Trans_x(a) Trans_z(d) Rot_z(theta)",
        ("fullam.model.craig.craig_transform",),
        (
            "tests/model/test_craig.py::test_transform_4_is_craigs_product",
            "tests/model/test_craig.py::test_printed_4_contradicts_its_text_and_ours_does_not",
        ),
    ),
    (
        "chain",
        "^0T_i = T_WA ^AT_0 prod_k ^{k-1}A_k",
        (
            "fullam.model.craig.chain_transforms",
            "fullam.dynamics.kinematics.attitudes",
        ),
        ("tests/model/test_craig.py::test_chain_5_is_pinocchios_forward_kinematics",),
    ),
    (
        "positions",
        "p_i = p_{i-1} + R_{i-1} ^{i-1}P_i;  p_i^c = p_i + R_i ^iP_i^c",
        ("fullam.dynamics.kinematics.positions",),
        ("tests/dynamics/test_kinematics.py::test_positions_6_and_motion_are_pinocchios",),
    ),
    (
        "rates of the Euler angles",
        "(dphi, dpsi, dgamma) = [[1, s_phi t_psi, -c_phi t_psi], [0, c_phi, s_phi], [0, "
        "-s_phi / c_psi, c_phi / c_psi]] w_W",
        ("fullam.dynamics.rotations.euler_rates",),
        (
            "tests/dynamics/test_rotations.py::test_euler_rates_7_are_the_derivative_of_the_angles_of_2",
        ),
    ),
    (
        "angular velocities",
        "w_i = w_{i-1} + R_i Z_0 dtheta_i",
        (
            "fullam.dynamics.kinematics.angular_velocities",
            "fullam.dynamics.recursion.arm_load",
        ),
        (
            "tests/dynamics/test_kinematics.py::test_angular_velocity_8_is_the_derivative_of_the_attitudes_5",
        ),
    ),
    (
        "velocities",
        "dp_i = dp_{i-1} + w_{i-1} x R_{i-1} ^{i-1}P_i;  dp_i^c = dp_i + w_i x R_i ^iP_i^c",
        ("fullam.dynamics.kinematics.velocities",),
        (
            "tests/dynamics/test_kinematics.py::test_velocities_9_are_the_derivative_of_the_positions_6",
        ),
    ),
    (
        "angular accelerations",
        "dw_i = dw_{i-1} + w_i x R_i Z_0 dtheta_i + R_i Z_0 ddtheta_i",
        ("fullam.dynamics.kinematics.angular_accelerations",),
        (
            "tests/dynamics/test_kinematics.py::test_angular_acceleration_10_is_the_second_derivative_of_the_attitudes_5",
        ),
    ),
    (
        "accelerations",
        "ddp_i = ddp_{i-1} + dw_{i-1} x L + w_{i-1} x (w_{i-1} x L), L = R_{i-1} "
        "^{i-1}P_i;  ddp_i^c likewise from ddp_i",
        ("fullam.dynamics.kinematics.accelerations",),
        (
            "tests/dynamics/test_kinematics.py::test_accelerations_11_are_the_second_derivative_of_the_positions_6",
        ),
    ),
    (
        "dynamics of the platform",
        "I_A dw_A + w_A x I_A w_A = U_tau - tau_1 - r_A^out x f_1;  m_A ddp_A = U_f - f_1 + m_A g",
        (
            "fullam.dynamics.newton_euler.root_wrench",
            "fullam.dynamics.newton_euler.platform_residual",
            "fullam.dynamics.recursion.base_acceleration",
        ),
        (
            "tests/dynamics/test_newton_euler.py::test_residual_of_12_vanishes",
            "tests/dynamics/test_witnesses.py::test_all_witnesses_agree",
        ),
    ),
    (
        "dynamics of a link",
        "I_i dw_i + w_i x I_i w_i = tau_i + r_i^in x f_i - tau_{i+1} - r_i^out x "
        "f_{i+1};  m_i ddp_i^c = f_i - f_{i+1} + m_i g",
        (
            "fullam.dynamics.newton_euler.joint_wrenches",
            "fullam.dynamics.newton_euler.link_residuals",
            "fullam.dynamics.recursion.arm_load",
        ),
        (
            "tests/dynamics/test_newton_euler.py::test_residual_of_13_vanishes",
            "tests/dynamics/test_witnesses.py::test_all_witnesses_agree",
        ),
    ),
    (
        "inertia in world axes",
        "I_A^W = R_WA I_A R_WA^T",
        (
            "fullam.dynamics.rotations.world_inertia",
            "fullam.dynamics.recursion.rotate_inertia",
        ),
        (
            "tests/dynamics/test_rotations.py::test_world_inertia_14_keeps_principal_moments_and_turns_axes",
        ),
    ),
    (
        "skew matrix",
        "s(v) x = v x x",
        ("fullam.dynamics.rotations.skew",),
        ("tests/dynamics/test_rotations.py::test_skew_15_is_the_cross_product",),
    ),
    (
        "exponential",
        "R = 1 + s(v) sin(theta) + s(v)^2 (1 - cos(theta))",
        (
            "fullam.dynamics.rotations.exponential",
            "fullam.dynamics.so3.exponential",
        ),
        ("tests/dynamics/test_rotations.py::test_exponential_16_is_the_matrix_exponential",),
    ),
    (
        "attitude error",
        "R_e = R_d R_c^T",
        (
            "fullam.dynamics.rotations.relative_rotation",
            "fullam.dynamics.rotations.attitude_error",
        ),
        (
            "tests/dynamics/test_rotations.py::test_relative_rotation_17_leads_from_current_to_desired_in_world_axes",
        ),
    ),
    (
        "axis and angle",
        "theta_e v_e = log(R_e)",
        (
            "fullam.dynamics.rotations.logarithm",
            "fullam.dynamics.so3.logarithm",
        ),
        (
            "tests/dynamics/test_rotations.py::test_logarithm_18_is_right_at_every_angle",
            "tests/dynamics/test_rotations.py::test_printed_logarithm_18_fails_at_both_ends",
        ),
    ),
    (
        "PID",
        "u_pid = k_p e + k_i int e dt + k_d de/dt",
        ("fullam.control.pid.pid",),
        ("tests/control/test_control_equations.py::test_pid_19_is_the_sum_of_its_three_terms",),
    ),
    (
        "dynamic compensation",
        "u_dc = [f_1 - m_A g; w_A x I_A w_A + tau_1 + r_A^out x f_1]",
        (
            "fullam.dynamics.recursion.compensation",
            "fullam.control.compensation.JointOne",
            "fullam.dynamics.matrix_system.compensation",
            "fullam.dynamics.multibody.Multibody.compensation",
        ),
        (
            "tests/dynamics/test_matrix_system.py::test_compensation_20_with_26_achieves_the_wanted_acceleration",
            "tests/dynamics/test_matrix_system.py::test_printed_compensation_20_does_not",
            "tests/dynamics/test_witnesses.py::test_all_witnesses_agree",
        ),
    ),
    (
        "linear system",
        "[M_A; M_1; ...; M_n] X_s = [b_A; b_1; ...; b_n]",
        (
            "fullam.dynamics.matrix_system.MatrixSystem",
            "fullam.dynamics.matrix_system.MatrixSystem.solve_wrench",
            "fullam.dynamics.recursion.platform_acceleration",
        ),
        (
            "tests/dynamics/test_matrix_system.py::test_solution_21_is_the_recursions",
            "tests/dynamics/test_witnesses.py::test_all_witnesses_agree",
        ),
    ),
    (
        "rows of the platform",
        "I_A dw_A + s(r_A^out) f_1 + tau_1 = U_tau - wIw_A;  m_A ddp_A + f_1 = U_f + G_A",
        ("fullam.dynamics.matrix_system.MatrixSystem.assemble",),
        (
            "tests/dynamics/test_matrix_system.py::test_solution_21_is_the_recursions",
            "tests/dynamics/test_witnesses.py::test_all_witnesses_agree",
        ),
    ),
    (
        "rows of link 1",
        "as (24) with i = 1 and the platform as link 0",
        ("fullam.dynamics.matrix_system.MatrixSystem.assemble",),
        (
            "tests/dynamics/test_matrix_system.py::test_solution_21_is_the_recursions",
            "tests/dynamics/test_witnesses.py::test_all_witnesses_agree",
        ),
    ),
    (
        "rows of link i",
        "moment, force, dw_i - dw_{i-1} = h_i, ddp_i^c - ddp_i - s_i^1 dw_i = g_i^1, "
        "ddp_i - ddp_{i-1} - s_i^2 dw_{i-1} = g_i^2",
        ("fullam.dynamics.matrix_system.MatrixSystem.assemble",),
        (
            "tests/dynamics/test_matrix_system.py::test_solution_21_is_the_recursions",
            "tests/dynamics/test_witnesses.py::test_all_witnesses_agree",
            "tests/dynamics/test_matrix_system.py::test_layout_gives_each_unknown_and_each_equation_one_place",
        ),
    ),
    (
        "constants of the system",
        "I_i, wIw_i, G_i, h_i, s_i^1, s_i^2, g(w, R, P) = w x (w x R P)",
        (
            "fullam.dynamics.matrix_system.MatrixSystem.assemble",
            "fullam.dynamics.kinematics.centripetal",
            "fullam.dynamics.kinematics.joint_angular_terms",
            "fullam.dynamics.newton_euler.gyroscopic_moments",
        ),
        (
            "tests/dynamics/test_matrix_system.py::test_solution_21_is_the_recursions",
            "tests/dynamics/test_witnesses.py::test_all_witnesses_agree",
        ),
    ),
    (
        "dc-PID",
        "u = blkdiag(m_A 1, I_A) u_pid + u_dc",
        (
            "fullam.control.dc_pid.dc_pid",
            "fullam.control.dc_pid.DcPid",
            "fullam.dynamics.matrix_system.platform_inertia",
        ),
        (
            "tests/control/test_control_equations.py::test_dc_pid_26_is_inertia_times_u_pid_plus_u_dc",
            "tests/dynamics/test_matrix_system.py::test_compensation_20_with_26_achieves_the_wanted_acceleration",
        ),
    ),
    (
        "thrust",
        "f = k_f Omega_i^2",
        ("fullam.model.rotors.thrust",),
        ("tests/model/test_rotor_equations.py::test_thrust_27_grows_with_the_square",),
    ),
    (
        "force of a rotor",
        "F_i = e_i^F k_f Omega_i^2",
        ("fullam.model.rotors.rotor_forces",),
        ("tests/model/test_rotor_equations.py::test_forces_28_lie_along_the_axes_and_sum_to_29",),
    ),
    (
        "total force",
        "F = k_f e^F Omega",
        ("fullam.model.rotors.net_force",),
        ("tests/model/test_rotor_equations.py::test_forces_28_lie_along_the_axes_and_sum_to_29",),
    ),
    (
        "moment of a rotor",
        "tau_i = r_i x e_i^F k_f Omega_i^2 + d_i k_tau e_i^F Omega_i^2",
        ("fullam.model.rotors.rotor_moments",),
        ("tests/model/test_rotor_equations.py::test_moment_30_is_lever_arm_plus_drag",),
    ),
    (
        "moment as a product",
        "tau_i = s_tau(r_i, d_i, k_f, k_tau) e_i^F Omega_i^2",
        ("fullam.model.rotors.moment_map",),
        ("tests/model/test_rotor_equations.py::test_moment_map_31_32_times_axis_is_the_moment_30",),
    ),
    (
        "s_tau",
        "s_tau(r, d, k_f, k_tau) = s(k_f r) + d k_tau 1",
        ("fullam.model.rotors.moment_map",),
        ("tests/model/test_rotor_equations.py::test_moment_map_31_32_times_axis_is_the_moment_30",),
    ),
    (
        "total moment",
        "tau = M_tau Omega, column i: s_tau(r_i, d_i, k_f, k_tau) e_i^F",
        ("fullam.model.rotors.moment_matrix",),
        ("tests/model/test_rotor_equations.py::test_moment_matrix_33_sums_the_moments_30",),
    ),
    (
        "coupling matrix",
        "[F; tau] = [k_f e^F; M_tau] Omega",
        (
            "fullam.model.rotors.coupling_matrix",
            "fullam.simulation.plants.plant.rotor_wrench",
        ),
        ("tests/model/test_rotor_equations.py::test_coupling_matrix_34_stacks_29_and_33",),
    ),
    (
        "rotor wrench in the world",
        "[U_f; U_tau] = blkdiag(R_A, R_A) [k_f e^F; M_tau] Omega",
        ("fullam.model.rotors.world_wrench",),
        ("tests/model/test_rotor_equations.py::test_world_wrench_35_turns_both_halves",),
    ),
)
