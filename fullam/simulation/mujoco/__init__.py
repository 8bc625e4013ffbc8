"""MuJoCo as a plant: its model of vehicle and scene, its engine, its contacts."""
