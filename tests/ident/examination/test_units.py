"""A position in another unit, and what only looks like one."""

import pyarrow as pa
import pytest
from planted import ON_RECORDINGS, planted
from two_links import TWO_LINKS

import ident
from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.twin import simulate


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    path = tmp_path_factory.mktemp("arm") / "two_links.yaml"
    path.write_text(TWO_LINKS)
    return path


def _checks(arm, effect):
    made = simulate(arm, effects=(effect,), seed=3)
    runs = [ident.Recording(pa.table(dict(r.columns)), r.use, name=r.label) for r in made.recordings]
    study = ident.Study(robot=str(arm), recordings=runs)
    return [c for c in ident.fit(study).checks if c.check == "angle_unit"]


@pytest.mark.parametrize("stiffness", [1.0, 5.0, 20.0])
@pytest.mark.parametrize("joint", [1, 2])
def test_a_spring_is_no_position_in_another_unit(arm, joint, stiffness):
    """sin(q / 2) is nearly k q."""
    assert not _checks(arm, f"spring:{joint}:k={stiffness},q0=0")


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize(("joint", "factor"), [(2, 2.0), (3, 0.5)])
def test_a_measured_position_in_another_unit_is_told(tmp_path, joint, factor):
    names = {f"{d}q{joint}" for d in ("", "d", "dd")}
    study = planted(tmp_path, lambda c: {k: factor * v if k in names else v for k, v in c.items()})
    (said,) = [c for c in examine_fit(prepare_study(study)) if c.check == "angle_unit"]
    assert said.signals == (f"q{joint}",) and f"scale: {1 / factor:g}" in said.remedy
