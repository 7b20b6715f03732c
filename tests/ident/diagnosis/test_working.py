"""What a diagnosis works on: a study with what its checks propose, where that leads to a fit at all."""

import pytest
from planted import ON_RECORDINGS, planted, ur10e

from ident.diagnosis import working
from ident.diagnosis.working import working_study
from ident.errors import FitFailedError
from ident.progress import silent


@pytest.mark.parametrize("leads", [True, False])
def test_a_study_without_a_fit_is_that_of_what_its_checks_propose(monkeypatch, leads):
    """And where a line that a check proposes leads nowhere, the error is the study's own."""
    study, known = ur10e(), type("Known", (), {"prepared": None, "checks": ()})
    proposed = study.with_(gravity=(9.81, 0.0, 0.0))

    def fit(its, **_):
        if its is study or not leads:
            raise FitFailedError("as it is" if its is study else "with the line")
        return "a fit"

    monkeypatch.setattr(working, "fit_study", fit)
    monkeypatch.setattr(working, "examined", lambda *_: known)
    monkeypatch.setattr(working, "examine_tables", lambda _: ())
    monkeypatch.setattr(working, "mended_study", lambda *_: proposed)
    if not leads:
        with pytest.raises(FitFailedError, match="as it is"):
            working_study(study, silent)
        return
    its = working_study(study, silent)
    assert its.study is its.mended is proposed and its.before is its.base == "a fit"
    assert its.notes == ("as it is the study has no fit: errors before are those without its faults",)


@pytest.mark.long
@pytest.mark.real_data
@ON_RECORDINGS[1]
def test_a_sign_is_undone_and_the_errors_before_are_those_with_it(tmp_path):
    study = planted(tmp_path, lambda c: c | {"i2": -c["i2"]})
    its = working_study(study, silent)
    assert its.mended is its.study and its.notes == () and not its.known.checks
    before, after = (fit.full_rate_error["validate"]["tau_m2"] for fit in (its.before, its.base))
    plain = working_study(ur10e(), silent)
    assert plain.mended is None and plain.before is plain.base and plain.study == ur10e()
    assert after == pytest.approx(plain.base.full_rate_error["validate"]["tau_m2"]) and after < before / 2
