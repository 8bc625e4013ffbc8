"""What a run means: metrics, capability of a vehicle, agreement of the models."""
