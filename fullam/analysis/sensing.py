"""Before take-off: does an estimator bear what the weather does to the sensors."""

from __future__ import annotations

from fullam.control.estimators import estimator_class
from fullam.control.kalman_bias import KalmanBias
from fullam.simulation.weather import Weather


def sensor_warning(weather: Weather, estimator: str) -> str | None:
    """What an estimator takes for true that is not, and which one does not, in a line; or None.

    Args:
        weather: What the flight meets.
        estimator: Name of the estimator.

    Raises:
        UnknownName: No such estimator.
    """
    errors, cls = weather.sensors, estimator_class(estimator)
    believed = []
    if errors.are_biased and cls.needs_inertial and not cls.knows_bias:
        rate, force = max(errors.gyroscope_bias_deg), max(errors.accelerometer_bias_mg)
        believed.append(f"the bias of inertial sensors (to {rate:g} deg/s and {force:g} mg)")
    if errors.have_outliers and not cls.rejects_outliers:
        share, far = 100.0 * errors.outlier_share, errors.outlier_distance
        angle = errors.outlier_angle_deg
        believed.append(f"outliers of the pose ({share:g} %, {far:g} m and {angle:g} deg off)")
    if errors.have_gaps and not cls.needs_inertial:
        believed.append(f"a pose that has not come for {errors.gap_duration:g} s")
    if not believed:
        return None
    told = " and ".join(believed)
    return f"the estimator {estimator} takes {told} for true: fly it with {KalmanBias.name}"
