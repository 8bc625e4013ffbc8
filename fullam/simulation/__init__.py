"""What happens: plant, sensors, weather, references, scenarios, and the run they leave."""

import fullam.simulation.catalogue  # noqa: F401 - the paper's scenarios are known by name
