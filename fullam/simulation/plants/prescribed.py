"""The plant whose joints follow their motion theta(t) exactly; see `plant`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fullam.dynamics.integrators import integrator
from fullam.numbers.program import Stage
from fullam.numbers.records import Rows
from fullam.simulation.plants.kind import Plant, PythonStage, SeenArm, Surroundings
from fullam.simulation.plants.plant import PinocchioRate, PlantView, advance, plant_stage


class PrescribedPlant(Plant):
    """Joints on rails: the controller knows their motion, ahead and exactly."""

    name = "prescribed"

    def __init__(self, around: Surroundings) -> None:
        """Read the arm from the plan's tables."""
        super().__init__(around)
        tables = around.tables
        self.seen = SeenArm(tables.links, tables.motions, *tables.placed, tables.joint_rows)

    def stages(self) -> dict[str, Stage]:
        """See `Plant`."""
        name = self.around.tables.plan.simulation.integrator
        return {"move": Stage(plant_stage(name), self._view(self.seen.joints))}

    def python_stages(self, look: Callable[[Any], Any]) -> dict[str, PythonStage]:
        """See `Plant`; by Pinocchio."""
        plan = self.around.tables.plan
        rule, rate = integrator(plan.simulation.integrator).step, PinocchioRate(plan.true)

        def move(view: Any, k: int) -> None:
            advance(rule, rate, view, k)

        return {"move": (move, look(self._view(self.seen.motions)))}

    def steered_by(self, arm: Any, centers: Any, rows: Any) -> dict[str, dict[str, Any]]:
        """See `Plant`."""
        stepping = self.around.tables.stepping.to_list()
        return {
            "allocate": {"centers": centers, "joint_rows": rows},
            "command": {"joints": arm, "joint_rows": rows},
            "move": {"arm": arm, "stepping": [stepping[0]._replace(arm_stride=1.0)]},
        }

    def _view(self, arm: Rows) -> PlantView:
        a = self.around
        return PlantView(
            a.state,
            a.drawn.links,
            arm,
            a.drawn.rotors,
            a.tables.stepping,
            a.drawn.gust,
            a.speeds,
            a.commands,
        )
