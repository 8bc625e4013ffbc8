"""The scenario `peg-in-hole`, in MuJoCo: a peg at the tool is pushed into a hole near its way.

It is for `hybrid-force`, which pushes along +x with 3 N. The hole is 20 mm wide and 40 mm deep,
the peg 16 mm thick and round at its tip; the hole lies 3 mm beside and 2 mm below the peg's way,
so that its rounded rim has to lead the peg in, against the platform's hold on its position.
"""

from __future__ import annotations

from fullam.simulation.motions.references import Step
from fullam.simulation.scenarios.interaction import AHEAD_DEG, HOME, YAW_DEG
from fullam.simulation.scenarios.scenario import Scenario, register_scenario
from fullam.simulation.world.world_file import WorldFile

FACE, BOTTOM = 0.70, 0.74
"""x of the block's face and of the hole's bottom [m]."""

PEG = 0.058
"""From the tool's point to the peg's tip [m]."""

SCENE = """
<mujoco model="peg in hole">
  <default>
    <geom friction="0.2 0.005 0.0001" rgba="0.6 0.6 0.65 1"/>
    <default class="rim"><geom type="capsule" size="0.004 0.018"/></default>
  </default>
  <worldbody>
    <body name="tool">
      <geom name="peg" type="capsule" size="0.008" fromto="0 0 0.02  0 0 0.05" mass="0.01"/>
    </body>
    <body name="block" pos="0.704 0.003 0.938">
      <geom name="left"  type="box" pos="0.048  0.055 0" size="0.048 0.045 0.1"/>
      <geom name="right" type="box" pos="0.048 -0.055 0" size="0.048 0.045 0.1"/>
      <geom name="above" type="box" pos="0.048 0  0.055" size="0.048 0.01 0.045"/>
      <geom name="below" type="box" pos="0.048 0 -0.055" size="0.048 0.01 0.045"/>
      <geom name="bottom" type="box" pos="0.066 0 0" size="0.03 0.01 0.01"/>
      <geom name="rim left"  class="rim" pos="0  0.014 0"/>
      <geom name="rim right" class="rim" pos="0 -0.014 0"/>
      <geom name="rim above" class="rim" pos="0 0  0.014" euler="90 0 0"/>
      <geom name="rim below" class="rim" pos="0 0 -0.014" euler="90 0 0"/>
    </body>
  </worldbody>
</mujoco>
"""

register_scenario(
    Scenario(
        name="peg-in-hole",
        description="Push a peg into a hole 3 mm off its way, in MuJoCo",
        controller="hybrid-force",
        initial_position=HOME,
        initial_euler_deg=YAW_DEG,
        initial_arm_deg=AHEAD_DEG,
        reference=Step(HOME, YAW_DEG),
        duration=9.0,
        world_file=WorldFile("peg-in-hole.xml", SCENE),
    )
)
