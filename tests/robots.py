"""Robot descriptions that several tests use."""

from terrainkit_robots.description import bundled

QUADRUPED = bundled.urdf_path("quadruped")
"""The URDF of the bundled quadruped; its MJCF is in the same folder."""

BUNDLED = [f"{name}{suffix}" for name in bundled.robot_names() for suffix in (".urdf", ".xml")]
"""Names of all bundled files, such as `quadruped.xml`. `robot_file` finds them."""

ROBOTS = [*BUNDLED, "tilted.urdf", "looped.xml"]
"""Names of the bundled files, and of those in tests/terrainkit_robots/robots."""

BOX = """<robot name="{name}">
  <link name="trunk">
    <inertial>
      <mass value="{mass}"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision>
  </link>
  <link name="top"/>
  <joint name="top_joint" type="fixed"><parent link="trunk"/><child link="top"/></joint>
</robot>
"""
"""The URDF of a robot with one rigid body, with a name and a mass [kg] to fill in."""

ARM = """<robot name="arm">
  <link name="stand"><inertial><mass value="5"/>
    <inertia ixx="0.05" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
  <link name="upper"><inertial><origin xyz="0 0 0.15"/><mass value="1"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 0.16"/><geometry><box size="0.05 0.05 0.3"/></geometry></collision>
  </link>
  <joint name="shoulder" type="revolute"><parent link="stand"/><child link="upper"/>
    <origin xyz="0 0 0.11"/><axis xyz="0 1 0"/>
    <limit lower="-1.5" upper="1.5" effort="30" velocity="3"/></joint>
</robot>"""
"""The URDF of an arm with a fixed base and one joint, without errors."""

PENDULUM = """
<robot name="pendulum">
  <link name="pole"/>
  <link name="bob">
    <inertial><origin xyz="0.5 0 0"/><mass value="2"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="j" type="revolute">
    <parent link="pole"/><child link="bob"/><axis xyz="0 1 0"/>
    <limit lower="-4" upper="4" effort="10" velocity="10"/>
  </joint>
</robot>
"""
"""The URDF of a bob of 2 kg, 0.5 m from a joint of a fixed link."""
