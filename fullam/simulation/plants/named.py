"""The plants by name: which physics a flight has, whoever flies it."""

from __future__ import annotations

from fullam.simulation.mujoco.plant import MujocoPlant, MujocoPrescribedPlant
from fullam.simulation.plants.kind import Plant, Surroundings
from fullam.simulation.plants.prescribed import PrescribedPlant
from fullam.simulation.plants.servo import ServoPlant

PLANTS: dict[str, type[Plant]] = {
    plant.name: plant for plant in (PrescribedPlant, ServoPlant, MujocoPlant, MujocoPrescribedPlant)
}
"""Every plant; `settings.PLANT_SETTINGS` has what may be chosen of each."""


def make_plant(around: Surroundings) -> Plant:
    """The plant that a plan names, around the rows of a block."""
    return PLANTS[around.tables.plan.simulation.plant](around)
