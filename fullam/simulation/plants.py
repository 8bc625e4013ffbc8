"""The plants by name: which physics a flight has, whoever flies it."""

from __future__ import annotations

from fullam.simulation.mujoco_plant import MujocoPlant, MujocoPrescribedPlant
from fullam.simulation.plant_kind import Plant, Surroundings
from fullam.simulation.prescribed_plant import PrescribedPlant
from fullam.simulation.servo_plant import ServoPlant

PLANTS: dict[str, type[Plant]] = {
    plant.name: plant for plant in (PrescribedPlant, ServoPlant, MujocoPlant, MujocoPrescribedPlant)
}
"""Every plant; `plant_settings.PLANT_SETTINGS` has what may be chosen of each."""


def make_plant(around: Surroundings) -> Plant:
    """The plant that a plan names, around the rows of a block."""
    return PLANTS[around.tables.plan.simulation.plant](around)
