"""What happens: plant, sensors, weather, references, scenarios, and the run they leave."""
