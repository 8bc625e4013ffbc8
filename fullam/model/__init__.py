"""What the vehicle is: constant data, from URDF and TOML to model and rotors."""
