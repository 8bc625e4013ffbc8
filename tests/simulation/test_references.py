"""References: tabulation and checking."""

import numpy as np
import pytest

from fullam.dynamics.pose_space import euler_from_pose, pose_from_euler
from fullam.exceptions import ScenarioError, UnknownName
from fullam.simulation.motions import references
from fullam.simulation.motions.references import (
    Circle,
    ReferenceTable,
    Step,
    Waypoints,
    tabulate,
)

T = np.arange(601) * 0.01
START = pose_from_euler(np.array([0.0, 0.0, 1.0]), np.zeros(3))
HOME = pose_from_euler(np.array([9.0, 9.0, 9.0]), np.radians([15.0, -20.0, 10.0]))


def test_a_step_waits_and_then_stays():
    table = tabulate(Step((1.0, 2.0, 3.0), (10.0, 20.0, 30.0), at=1.0), T, HOME)
    np.testing.assert_allclose(table.pose[99], HOME)
    np.testing.assert_allclose(table.pose[100:, :3], np.tile([1.0, 2.0, 3.0], (501, 1)))
    np.testing.assert_allclose(np.degrees(euler_from_pose(table.pose[-1])), [10, 20, 30])


def test_waypoints_follow_each_other():
    reference = Waypoints((0.0, 2.0), ((1, 0, 0), (2, 0, 0)), ((0, 0, 0), (0, 0, 90)))
    table = tabulate(reference, T, HOME)
    np.testing.assert_allclose(table.pose[[0, 199, 200, 600], 0], [1, 1, 2, 2])


def test_a_circle_moves_as_its_derivatives_say():
    """Central differences at 1e-2 s of a motion with derivatives below 4: error 1e-4."""
    table = tabulate(Circle((0, 0, 2), radius=1.0, period=5.0), T, HOME)
    speed = np.gradient(table.pose[:, :3], T, axis=0)[1:-1]
    np.testing.assert_allclose(speed, table.velocity[1:-1, :3], atol=5e-4)
    curve = np.gradient(table.velocity[:, :3], T, axis=0)[1:-1]
    np.testing.assert_allclose(curve, table.acceleration[1:-1, :3], atol=5e-4)


def test_a_time_typed_in_decimals_falls_on_its_tick():
    for rate in (60, 100, 120, 240):
        t = np.arange(20 * rate) * (1.0 / rate)
        for at in np.arange(1, 200) / 10:
            table = tabulate(Step((1.0, 0.0, 0.0), at=at), t, START)
            first = int(np.argmax(table.pose[:, 0] > 0.5))
            assert first == int(np.ceil(at * rate - 1e-6)), (rate, at)


def test_nan_in_a_reference_names_column_and_time():
    class Broken:
        kind = "broken"

        def tabulate(self, t, initial_pose):
            pose = np.tile(initial_pose, (t.size, 1))
            pose[250, 2] = np.nan
            return ReferenceTable(t, pose, np.zeros((t.size, 6)), np.zeros((t.size, 6)))

    with pytest.raises(ScenarioError, match=r"broken.*pose\[2\] at t = 2\.5 s.*not finite"):
        tabulate(Broken(), T, HOME)


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: Step((1.0, np.nan, 0.0)), "position"),
        (lambda: Step((1.0, 2.0)), "position"),
        (lambda: Step((0, 0, 0), at=-1.0), "at"),
        (lambda: Waypoints((1.0, 1.0), ((0, 0, 0),) * 2, ((0, 0, 0),) * 2), "times"),
        (lambda: Waypoints((0.0, 1.0), ((0, 0, 0),), ((0, 0, 0),) * 2), "positions"),
        (lambda: Circle((0, 0, 0), radius=0.0), "radius"),
    ],
)
def test_bad_numbers_name_the_field(make, field):
    with pytest.raises(ScenarioError, match=field):
        make()


def test_plain_data_and_back():
    for reference in (
        Step((1.0, 2.0, 3.0), at=0.5),
        Waypoints((0.0, 1.0), ((0.0, 0.0, 0.0),) * 2, ((0.0, 0.0, 9.0),) * 2),
        Circle((0.0, 0.0, 1.0)),
    ):
        data = references.to_dict(reference)
        assert references.from_dict(references.KINDS, "reference", data) == reference
    with pytest.raises(UnknownName, match="waypoints"):
        references.from_dict(references.KINDS, "reference", {"kind": "spline"})
    with pytest.raises(ScenarioError, match=r"positon.*it has position"):
        references.from_dict(references.KINDS, "reference", {"kind": "step", "positon": (1, 2, 3)})
