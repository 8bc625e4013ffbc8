"""Fully-actuated aerial manipulators on Pinocchio."""
