"""What happens: plant, sensors, weather, references, scenarios, and the run they leave."""

import fullam.simulation.catalogue
import fullam.simulation.interaction  # noqa: F401 - the paper's scenarios, and those that touch
