"""Check a robot file, and onboard the robot: its pose, gains and files for training.

Install: pip install . (in a clone of terrainkit)
Run: python onboard_robot.py [my_robot.urdf]; by default, a file with a mistake in it.
"""

import sys
from pathlib import Path

from terrainkit_robots import OnboardOptions, check_robot, onboard
from terrainkit_robots.description import bundled

path = Path("my_robot.urdf")
if sys.argv[1:]:
    path = Path(sys.argv[1])
else:  # the bundled quadruped, with an axis that is not a unit vector
    text = bundled.urdf_path("quadruped").read_text()
    path.write_text(text.replace('<axis xyz="0 1 0"/>', '<axis xyz="0 2 0"/>', 1))

report = check_robot(path)
for finding in report.findings:
    if finding.severity != "note":
        print(f"{finding.file}:{finding.line}: {finding.severity} {finding.code}")
        print(f"  {finding.message}")

# A copy of the file is corrected. The frameworks get a configuration each.
frameworks = ("mjlab", "legged_gym")
options = OnboardOptions(frameworks=frameworks, render_images=False, overwrite=True)
result = onboard(path, "my_robot", options)
if result.robot is None:
    sys.exit("the robot has errors that have to be corrected first")
spec = result.robot.spec
print("corrected:", ", ".join(finding.code for finding in result.fixed) or "nothing")
print("feet:", ", ".join(spec.feet))
print("default pose [rad]:", dict(spec.default_pose))
print("stiffness [Nm/rad]:", dict(spec.stiffness))
print("stands in MuJoCo for 5 s:", "yes" if result.verification.is_stable else "no")
print(f"wrote {result.folder}: {', '.join(sorted(path.name for path in result.folder.iterdir()))}")
