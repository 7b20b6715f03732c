"""Helpers of several tests are modules of tests/support: `from pinocchio_robot import PinocchioRobot`."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "support"))
