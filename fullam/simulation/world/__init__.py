"""What stands around a flight, and what it does to the tool."""
