"""The physics behind a flight: joints prescribed, or free and moved by servos."""
