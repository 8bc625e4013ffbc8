import numpy as np
import pinocchio as pin
import pytest

from fullam.model.craig import (
    CraigRow,
    chain_transforms,
    craig_table,
    craig_transform,
    homogeneous,
    mount,
)
from fullam.model.loading import load_vehicle

ROUNDING = 1e-14
"""A few products of numbers of order one."""

URDF_ROUNDING = 1e-11
"""The URDF states its angles with twelve decimals; four of them add up over the chain."""

LENGTHS = (0.18, 0.18, 0.15, 0.09)
"""l_1..l_4 of the default vehicle [m]."""


def elementary(axis, angle):
    return homogeneous(pin.AngleAxis(angle, np.eye(3)[axis]).toRotationMatrix(), np.zeros(3))


def shift(axis, length):
    return homogeneous(np.eye(3), length * np.eye(3)[axis])


def printed_transform(alpha, a, d, theta):
    """Eq. (4) as printed: the distal Denavit-Hartenberg matrix."""
    ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(theta), np.sin(theta)
    return np.array(
        [
            [ct, -st * ca, st * sa, a * ct],
            [st, ct * ca, -ct * sa, a * st],
            [0, sa, ca, d],
            [0, 0, 0, 1],
        ]
    )


def offset_is_constant(transform):
    """What the text below eq. (4) states: P_i does not depend on theta."""
    offsets = [transform(0.4, 0.3, 0.2, theta)[:3, 3] for theta in (0.0, 1.0, -2.0)]
    return np.allclose(offsets, offsets[0], atol=ROUNDING)


def arm_matches_urdf(transform, vehicle, theta):
    """Whether the chain of Table 1 with this matrix puts the tool where the URDF has it."""
    T = mount()
    for row, angle in zip(craig_table(*LENGTHS), [*theta, 0.0], strict=True):
        T = T @ transform(row.alpha, row.a, row.d, angle)
    data = vehicle.create_data()
    pin.framesForwardKinematics(vehicle.model, data, vehicle.neutral(theta))
    tool = data.oMf[vehicle.model.getFrameId(vehicle.tool)]
    return np.allclose(T, tool.homogeneous, atol=URDF_ROUNDING)


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle("fullam")


def test_transform_4_is_craigs_product():
    rng = np.random.default_rng(0)
    for alpha, a, d, theta in rng.uniform(-3, 3, (50, 4)):
        product = elementary(0, alpha) @ shift(0, a) @ shift(2, d) @ elementary(2, theta)
        np.testing.assert_allclose(
            craig_transform(alpha, a, d, theta), product, atol=ROUNDING, rtol=0
        )


def test_printed_4_contradicts_its_text_and_ours_does_not():
    assert offset_is_constant(craig_transform)
    assert not offset_is_constant(printed_transform)


def test_printed_4_is_a_right_distal_matrix():
    # Transcribed right: Rot_z Trans_z Trans_x Rot_x. So it is the convention that is wrong.
    product = elementary(2, 0.7) @ shift(2, 0.2) @ shift(0, 0.3) @ elementary(0, 0.4)
    np.testing.assert_allclose(printed_transform(0.4, 0.3, 0.2, 0.7), product, atol=ROUNDING)


def test_table_1_with_craigs_matrix_is_the_urdf_and_with_the_printed_one_is_not(vehicle):
    rng = np.random.default_rng(1)
    for theta in rng.uniform(-2.6, 2.6, (20, 4)):
        assert arm_matches_urdf(craig_transform, vehicle, theta)
        assert not arm_matches_urdf(printed_transform, vehicle, theta)


def test_urdf_joint_placements_are_the_craig_rows(vehicle):
    rows = craig_table(*LENGTHS)
    expected = [mount() @ rows[0].transform(), *(row.transform() for row in rows[1:4])]
    found = [vehicle.model.jointPlacements[j].homogeneous for j in range(2, 6)]
    np.testing.assert_allclose(found, expected, atol=URDF_ROUNDING)


def test_chain_5_is_pinocchios_forward_kinematics(vehicle):
    rng = np.random.default_rng(2)
    theta = rng.uniform(-2.6, 2.6, (10, 4))
    turns = np.array([pin.exp3(x) for x in rng.uniform(-2, 2, (10, 3))])
    T_WA = homogeneous(turns, rng.normal(size=(10, 3)))
    frames = chain_transforms(T_WA, craig_table(*LENGTHS), theta, mount())
    assert frames.shape == (10, 5, 4, 4)
    data = vehicle.create_data()
    for k in range(10):
        pose = pin.SE3ToXYZQUAT(pin.SE3(T_WA[k]))
        pin.framesForwardKinematics(vehicle.model, data, np.concatenate([pose, theta[k]]))
        expected = [data.oMi[j].homogeneous for j in range(2, 6)]
        expected.append(data.oMf[vehicle.model.getFrameId("tool")].homogeneous)
        np.testing.assert_allclose(frames[k], expected, atol=URDF_ROUNDING)


def test_chain_5_without_mount_starts_at_the_platform():
    # Erratum of Table 1, row 1: as printed, {M_1} coincides with {A} at theta_1 = 0.
    T_WA = homogeneous(pin.exp3(np.array([0.1, 0.2, 0.3])), [1.0, 2.0, 3.0])
    frames = chain_transforms(T_WA, craig_table(*LENGTHS), np.zeros(4))
    np.testing.assert_allclose(frames[0], T_WA, atol=ROUNDING)


def test_fixed_rows_take_no_angle():
    rows = (CraigRow(0.0, 0.0, 0.0, fixed=True), CraigRow(0.0, 1.0, 0.0))
    frames = chain_transforms(np.eye(4), rows, np.array([np.pi / 2]))
    np.testing.assert_allclose(frames[0], np.eye(4), atol=ROUNDING)
    np.testing.assert_allclose(frames[1][:3, 0], [0, 1, 0], atol=ROUNDING)


@pytest.mark.parametrize(
    ("degrees", "direction"),
    [
        ((-90, 0, -90, 0), (0, 0, -1)),  # stretched straight down
        ((0, 0, -90, 0), (1, 1, 0)),  # stretched out level, along the arm's diagonal
    ],
)
def test_mount_gives_the_configurations_their_role(degrees, direction):
    theta = np.deg2rad(degrees)
    frames = chain_transforms(np.eye(4), craig_table(*LENGTHS), theta, mount())
    reach = frames[-1][:3, 3] - mount()[:3, 3]
    unit = np.array(direction) / np.linalg.norm(direction)
    np.testing.assert_allclose(reach, sum(LENGTHS) * unit, atol=ROUNDING)


def test_first_link_hangs_at_minus_ninety():
    theta = np.deg2rad([-90, 0, 0, 0])
    frames = chain_transforms(np.eye(4), craig_table(*LENGTHS), theta, mount())
    link = frames[1][:3, 3] - frames[0][:3, 3]
    np.testing.assert_allclose(link, [0, 0, -LENGTHS[0]], atol=ROUNDING)
