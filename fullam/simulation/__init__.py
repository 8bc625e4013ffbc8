"""What happens: plant, sensors, weather, references, scenarios, and the run they leave."""

import fullam.simulation.catalogue  # the paper's scenarios are known by name
import fullam.simulation.interaction  # and those that touch and carry things
import fullam.simulation.peg_in_hole  # and those in scenes of MuJoCo's
import fullam.simulation.turn_valve  # noqa: F401
