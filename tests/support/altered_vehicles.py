"""The default vehicle with something about its arm changed."""

import fullam
from fullam.model.vehicle import Vehicle


def with_joint(joint, kind, limits="", **definition):
    """With a joint of another kind, "prismatic" or "continuous".

    `limits` as attributes of the URDF's, 'lower="0" upper="0.3"', instead of its own, and
    `definition` what of the vehicle's changes.
    """
    vehicle = fullam.load_vehicle("fullam")
    start = vehicle.urdf.index(f'<joint name="{joint}"')
    end = vehicle.urdf.index("</joint>", start)
    text = vehicle.urdf[start:end].replace('type="revolute"', f'type="{kind}"')
    assert f'type="{kind}"' in text
    if limits:
        before, after = text.split("<limit", 1)
        text = f'{before}<limit effort="1.5" velocity="1" {limits}{after[after.index("/>") :]}'
    urdf = vehicle.urdf[:start] + text + vehicle.urdf[end:]
    return Vehicle.from_definition(vehicle.definition | definition, urdf)


def without_arm():
    """With its arm held: one body."""
    vehicle = fullam.load_vehicle("fullam")
    definition = {k: v for k, v in vehicle.definition.items() if k not in ("arm", "design")}
    held = dict.fromkeys(vehicle.arm_joints, 0.2)
    return Vehicle.from_definition(definition | {"name": "no arm", "held": held}, vehicle.urdf)
