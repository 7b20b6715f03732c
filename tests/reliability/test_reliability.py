"""A slice of `make reliability` with fixed seeds: nothing but accepted, or refused in one sentence."""

import warnings

import pytest

from tests.reliability import command_lines, fits, kills, planted, recordings, robot_files, studies
from tests.reliability.explore import explore, table
from tests.reliability.judge import Case, Hang, judged, time_limit

SLICE = ((robot_files, 250), (studies, 500), (recordings, 100), (fits, 30), (command_lines, 60))


@pytest.mark.parametrize(("module", "inputs"), SLICE, ids=lambda x: getattr(x, "__name__", "").split(".")[-1])
def test_every_input_is_accepted_or_refused_in_one_sentence(module, inputs):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        tally = explore(module.__name__, module.cases(), module.trial, inputs, chunk=inputs, shrink=False)
    print(table([tally]))  # shown with the seed when it fails
    assert not tally.failures, table([tally])
    assert tally.outcomes["refused"] and tally.outcomes["accepted"]  # it does try both


def one_of_each(module):
    """One case per defect and base, none left to chance."""
    for base in module.bases():
        for name, change in module.PLANTED:
            yield name, change, base


@pytest.mark.parametrize("module", [robot_files, studies], ids=["robot_files", "studies"])
def test_every_planted_defect_is_refused(module):
    import copy

    from tests.reliability.mutations import text_of

    for name, change, base in one_of_each(module):
        tree = copy.deepcopy(base)
        made = change(tree)
        data = made if isinstance(made, bytes) else text_of(tree)
        outcome = judged(module.trial, Case(data, name))
        assert outcome.kind == "refused", (name, outcome, data[:500])


@pytest.mark.parametrize("defect", planted.DEFECTS)
def test_every_planted_defect_of_a_recording_is_named(defect):
    assert judged(planted.trial, Case(planted.Planted(defect, 1), defect)).kind == "refused"


def test_nothing_is_said_of_the_recordings_before():
    from ident.equations.prepared import prepare_study
    from ident.examination.examine import examine_fit, examine_tables
    from ident.recordings.study import load_study

    prepared = prepare_study(load_study(planted._simulated()[0] / "study.yaml"))
    said = [*examine_tables(prepared), *examine_fit(prepared)]
    assert {check.check for check in said} <= {"poor_excitation"}  # of three joints, where gravity is


def test_the_untouched_bases_are_accepted(monkeypatch):
    from tests.reliability.mutations import text_of

    for module in (robot_files, studies):
        for base in module.bases():
            assert judged(module.trial, Case(text_of(base))).kind == "accepted", base
    for ending in recordings.FORMATS:
        recordings.trial(recordings.File(ending, recordings.written(recordings.columns(), ending)))


@pytest.mark.slow
@pytest.mark.first_case
@pytest.mark.parametrize("case", [("simulate", 2, 0.6), ("fit", 0, 0.5)])
def test_a_killed_command_leaves_the_old_result_whole(case):
    kills.trial(case)


def test_the_judge_knows_the_ways_to_fail():
    class Refusal(Exception):
        exit_status = 2

    def raising(error):
        def trial(_):
            raise error

        return trial

    def endless(_):
        while True:
            pass

    assert judged(raising(Refusal("run.csv: row 3: say why")), Case(0)).kind == "refused"
    assert judged(raising(Refusal("two\nlines")), Case(0)).kind == "babble"
    assert judged(raising(KeyError("x")), Case(0)).kind == "traceback"
    assert judged(lambda _: None, Case(0, "a defect")).kind == "silent"
    with pytest.raises(Hang), time_limit(0.05):
        endless(0)
