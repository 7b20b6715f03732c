"""What is asked of an effect besides that it says enough."""

from types import SimpleNamespace

import numpy as np
from small_arm import ARM

from ident.diagnosis.candidates import Library, screen
from ident.diagnosis.evidence import weigh
from ident.diagnosis.last_fit import _ended
from ident.diagnosis.opening import opened
from ident.diagnosis.weighing import is_itself
from ident.equations.prepared import prepare_study
from ident.recordings.study import load_study
from ident.twin import PlannedRun, Sensors, simulate, write_simulation
from modelgen.effects import catalogue


def test_a_change_of_the_model_shows_in_the_parameters_that_it_has(tiny):
    """Columns that a change lets in are any law: by them alone a left-out offset was told as a base that is
    turned by 0.03 degrees."""
    rng = np.random.default_rng(0)
    M = 400
    law, change = rng.normal(size=M), rng.normal(size=M)
    effect = SimpleNamespace(changes_model=True, linear=(), parameters_of=lambda place: ())
    for y, itself in ((law, False), (law + change, True)):
        m = tiny["metric"](tiny["rows"](np.ones((M, 1)), y + 0.1 * rng.normal(size=M)), 0.1)
        r = SimpleNamespace(
            term=SimpleNamespace(effect=effect, place=None),
            columns={0: np.column_stack([law, change])},
            sizes=np.ones(2),
        )
        assert is_itself(m, r, weigh(m, r.columns), 8.3, 0.01) is itself


def test_a_shape_that_ends_where_its_search_does_is_none():
    shapes = (SimpleNamespace(name="rho", grid=(0.4, 0.95)), SimpleNamespace(name="own", grid=(0.0, 0.3)))
    term = SimpleNamespace(effect=SimpleNamespace(nonlinear=shapes))

    def found(**values):
        told = {k: SimpleNamespace(value=v, at_bound=at) for k, (v, at) in values.items()}
        return SimpleNamespace(term=term, parameters=told)

    assert _ended(found(rho=(0.98, True), own=(0.1, False)))
    assert not _ended(found(rho=(0.7, False), own=(0.0, True)))  # a search begins at 0


def test_what_a_study_left_out_is_asked_of_every_joint(tmp_path_factory):
    """A budget of two places for one effect hid the others' viscous friction, and a square took its place."""
    folder = tmp_path_factory.mktemp("left_out")
    (folder / "robot.yaml").write_text(ARM)
    runs = (PlannedRun("run1", "identify", 14.0), PlannedRun("run2", "validate", 10.0))
    made = simulate(folder / "robot.yaml", "A", (), seed=3, sensors=Sensors(rate_hz=200.0), runs=runs)
    study = load_study(write_simulation(made, folder / "out")).with_(without=("viscous_friction",))
    begun = opened(prepare_study(study))
    library = Library(list(catalogue().values()), begun.layout)
    listed = {(r.term.effect.name, r.term.place.joint) for r in screen(begun.state, library, frozenset())}
    assert {("viscous_friction", joint) for joint in range(3)} <= listed
