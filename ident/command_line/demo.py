"""The main job on built-in data: a simulated robot hides an effect, and the loop has to find it.

Nothing of what is hidden reaches the study; the truth is written beside it and shown at the end.
"""

from pathlib import Path

from ident.progress import Progress, silent
from ident.twin import PlannedRun, SimulatedStudy, simulate, write_simulation

ROBOT, MODEL, HIDDEN, SEED = "kuka_lwr4p", "A", "stribeck_friction:4", 4
RUNS = (
    PlannedRun("points", "identify", 45.0, 22),
    PlannedRun("waves", "identify", 40.0),
    PlannedRun("other_waves", "validate", 30.0),
    PlannedRun("other_points", "test", 40.0, 20),
)
OPENING = (
    "A simulated Kuka LWR4+ records four runs of positions and motor torques. One of its joints has a "
    "friction that the model does not know. The loop identifies the arm, looks at what is left of the "
    "torque, and has to say what is missing, and where."
)


def record(folder: Path, progress: Progress = silent) -> SimulatedStudy:
    """Simulate the runs and write them with their study into `folder`."""
    simulated = simulate(ROBOT, MODEL, (HIDDEN,), seed=SEED, runs=RUNS, progress=progress)
    write_simulation(simulated, folder)
    return simulated


def answer(simulated: SimulatedStudy) -> str:
    """The hidden truth in words."""
    hidden = simulated.truth["effects"][0]
    values = ", ".join(f"{name} = {value:g}" for name, value in hidden["parameters"].items())
    joints = ", ".join(str(joint) for joint in hidden["joints"])
    return f"{hidden['effect'].replace('_', ' ')} on joint {joints}, {values}"
