"""What happens: plant, sensors, weather, references, scenarios, and the run they leave."""

import fullam.simulation.catalogue
import fullam.simulation.interaction
import fullam.simulation.peg_in_hole  # noqa: F401 - scenarios are known by name
