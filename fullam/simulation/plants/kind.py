"""What a plant is: the physics behind a flight, as rows and stages.

Whatever stands behind it, the rest of a flight asks five things of a plant: stages of its own, of
which `move` flies a control period; what the controller sees of the arm; the true arm; columns of
the record; and what it takes to begin anew. `named.PLANTS` names them, `simulate(plant=...)`
chooses one, and the driver flies it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fullam.numbers.program import Stage
from fullam.numbers.records import Rows
from fullam.simulation.draws import Drawn
from fullam.simulation.payloads.carrying import Carried
from fullam.simulation.tables import Tables
from fullam.simulation.world.scene_joints import SceneJoint

Array = NDArray[np.float64]
PythonStage = tuple[Callable[[Any, int], None], Any]


class Surroundings(NamedTuple):
    """The rows of a block that its plant reads and writes.

    What the flights share; lanes; rows of the record that are kept, 0 for none; the platform (one
    row of `plant.State`, to be written); estimate, target, command and delivery; weather and true
    vehicle; true rotor speeds (to be written) and those commanded.
    """

    tables: Tables
    lanes: int
    kept: int
    state: Rows
    estimate: Rows
    target: Rows
    command: Rows
    delivery: Rows
    drawn: Drawn
    speeds: Rows
    commands: Rows


class SeenArm(NamedTuple):
    """The arm as the controller sees it: rows, so many in a control period.

    The nominal links, in as many lanes as the joints; the arm's motion, the joints placed by it,
    and the centre of mass with them. A plant that knows them ahead has a row for every half step;
    one that senses rewrites one row.
    """

    links: Rows
    motions: Rows
    joints: Rows
    centers: Rows
    rows: Rows


class Plant(ABC):
    """The physics of some flights, in rows of its own.

    Attributes:
        name: By which it is chosen.
        around: The block's rows.
        seen: The arm as the controller sees it.
        arm: The true motion of the joints, rows of `JointMotion`; None if it is `seen.motions`.
        carried: What is known, or learned, to hang at the tool; None if there is nothing.
        touches: The force of the world on the tool, a row a period; None where nothing is touched.
        tool: Where the tool is in the world [m], a row a period, for flights that keep a track;
            None where nothing is asked of it, and where the arm follows its motion exactly.
        scene: The joints of the scene around it, whose coordinates are a column of the record.
        moved: Those coordinates, a row a period; None where no joint is.
    """

    name: ClassVar[str]
    seen: SeenArm
    arm: Rows | None = None
    carried: Carried | None = None
    touches: Rows | None = None
    tool: Rows | None = None
    scene: tuple[SceneJoint, ...] = ()
    moved: Rows | None = None

    def __init__(self, around: Surroundings) -> None:
        """Make the rows."""
        self.around = around

    def begin(self) -> None:
        """Stand at the scenario's start; the block has put the platform there."""
        return

    @abstractmethod
    def stages(self) -> dict[str, Stage]:
        """Its stages as kernels, by their names in `stages.ORDER`; "move" among them.

        Raises:
            SettingsError: It is not written as kernels.
        """

    @abstractmethod
    def python_stages(self, look: Callable[[Any], Any]) -> dict[str, PythonStage]:
        """The same for Python, by another engine where there is one.

        Args:
            look: Gives a view as Python reads it.
        """

    def columns(self, rows: int, lane: int, copy: bool) -> dict[str, Array]:
        """Columns of the record that it wrote itself; as `Block.columns`."""
        return {}

    def remembered(self) -> Sequence[Rows]:
        """Rows that it takes to go back to a moment, beside the block's."""
        return ()

    @abstractmethod
    def steered_by(self, arm: Any, centers: Any, rows: Any) -> dict[str, dict[str, Any]]:
        """What the views of stages show instead while hands move the arm, by stage and field.

        Args:
            arm: Its commanded motion, row by row.
            centers: The nominal vehicle's centre of mass in such a row.
            rows: Rows in a control period, one row.
        """
