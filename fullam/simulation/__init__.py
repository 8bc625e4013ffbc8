"""What happens: plant, sensors, weather, references, scenarios, and the run they leave."""

import fullam.simulation.catalogue  # the paper's scenarios are known by name
import fullam.simulation.interaction  # noqa: F401 - and those that touch and carry things
