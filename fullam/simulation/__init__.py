"""What happens: plant, sensors, weather, references, scenarios, and the run they leave."""

import fullam.simulation.scenarios.catalogue  # the paper's scenarios are known by name
import fullam.simulation.scenarios.interaction  # and those that touch and carry things
import fullam.simulation.scenarios.peg_in_hole  # and those in scenes of MuJoCo's
import fullam.simulation.scenarios.turn_valve  # noqa: F401
