"""The emitted C, compiled as strictly as compilers go and run against Python on recorded motion."""

import ctypes
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from recordings import motion

from ident.export.c_source import c_code
from ident.export.combination import ExportError
from ident.signals.dry_friction import TurnOver

pytestmark = pytest.mark.unexamined

STRICT = ["-Wall", "-Wextra", "-Werror", "-pedantic", "-std=c99", "-Wconversion"]
COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="there is no C compiler here")


def compiled(fit, folder, float32):
    code = c_code(fit, fit.load_robot(), "arm", float32)
    (folder / "arm.h").write_text(code.header)
    (folder / "arm.c").write_text(code.source)
    command = [COMPILER, *STRICT, "-O1", "-shared", "-fPIC", "arm.c", "-o", "arm.so", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "arm.so"))


def run(library, name, real, channels, *arrays):
    """tau (N, channels) of arm_<name>, sample by sample."""
    out = np.zeros((len(arrays[0]), channels), real)
    function = getattr(library, f"arm_{name}")
    for k in range(len(out)):
        given = [np.ascontiguousarray(array[k], real) for array in arrays]
        function(*(a.ctypes.data_as(ctypes.c_void_p) for a in given), out[k].ctypes.data_as(ctypes.c_void_p))
    return out.astype(float)


@needs_compiler
@pytest.mark.parametrize(("float32", "tolerance"), [(False, 1e-12), (True, 1e-4)])
def test_c_is_the_fit(kept, tmp_path, float32, tolerance):
    library = compiled(kept, tmp_path, float32)
    real = np.float32 if float32 else np.float64
    _, q, dq, ddq = (x[::97] for x in motion(20, 100, 5))
    q, dq, ddq = (x.astype(real).astype(float) for x in (q, dq, ddq))
    model, chi = kept.columns.model, kept.columns.model_chi(kept.chi, None)
    drives = np.array([name.startswith(("Fv", "Fc", "Off")) for name in model.parameters])
    still, bodies, n = np.zeros_like(q), np.where(drives, 0, chi), len(model.channels)
    expected = {
        "torque": (model.torque(q, dq, ddq, chi), (q, dq, ddq)),
        "rigid": (model.torque(q, dq, ddq, bodies), (q, dq, ddq)),
        "gravity": (model.torque(q, still, still, bodies), (q,)),
        "friction": (model.torque(q, dq, ddq, chi - bodies), (dq,)),
        "compensation": (
            model.torque(q, still, still, bodies) + model.torque(q, dq, ddq, chi - bodies),
            (q, dq),
        ),
    }
    size = np.abs(expected["torque"][0]).max()  # the torque's size
    for name, (tau, arguments) in expected.items():
        np.testing.assert_allclose(
            run(library, name, real, n, *arguments), tau, atol=tolerance * size, err_msg=name
        )


@needs_compiler
def test_numbers_are_constants_with_names(kept, tmp_path):
    library = compiled(kept, tmp_path, False)
    header = (tmp_path / "arm.h").read_text()
    rules = kept.columns.regroups
    bare = [k for k, name in enumerate(kept.columns.parameters) if name in rules and not name.endswith("L")]
    own = [k for k in bare if kept.chi[k]]
    values = (ctypes.c_double * len(own)).in_dll(library, "arm_value")
    stds = (ctypes.c_double * len(own)).in_dll(library, "arm_std")
    for place, k in enumerate(own):
        name = kept.columns.parameters[k]
        assert (
            f"ARM_{name} = {place}, /* {kept.columns.units[k]}: {kept.columns.regroups[name][:100]}" in header
        )
        assert values[place] == kept.chi[k]
        assert stds[place] == pytest.approx(np.sqrt(kept.covariance[k, k]), rel=1e-15)
    assert "malloc" not in (tmp_path / "arm.c").read_text()


@needs_compiler
def test_a_smooth_sign_of_the_study_is_the_sign_of_the_c(kept, tmp_path):
    width = 0.05
    smooth = replace(kept, study=kept.study.with_(turn_over=(width,) * 7))
    library = compiled(smooth, tmp_path, False)
    dq = np.linspace(-0.2, 0.2, 9)[:, None] * np.ones(7)
    zeros, chi = np.zeros_like(dq), kept.columns.model_chi(kept.chi, None)
    drives = [name.startswith(("Fv", "Fc", "Off")) for name in kept.columns.model.parameters]
    expected = kept.columns.model.torque(zeros, dq, zeros, np.where(drives, chi, 0), sign=np.tanh(dq / width))
    np.testing.assert_allclose(run(library, "friction", np.float64, 7, dq), expected, atol=1e-12)


@needs_compiler
@pytest.mark.parametrize(("float32", "tolerance"), [(False, 1e-12), (True, 1e-4)])
def test_presliding_of_the_study_is_a_state_of_the_c(kept, tmp_path, float32, tolerance):
    """Two joints' dry friction takes a travel to turn over, one of them a rate as well."""
    rates, travels = (0.05, *[0.0] * 6), (0.02, 0.0, 0.4, *[0.0] * 4)
    slow = replace(kept, study=kept.study.with_(turn_over=rates, presliding=travels))
    library = compiled(slow, tmp_path, float32)
    real = np.float32 if float32 else np.float64
    _, q, dq, ddq = (x.astype(real).astype(float) for x in motion(20, 50, 5))
    sign = np.sign(dq)
    for j, (rate, travel) in enumerate(zip(rates, travels)):
        direct = np.tanh(dq[:, j] / rate) if rate else sign[:, j].copy()
        slid = TurnOver(rate, travel).state(q[:, j], dq[:, j], np.inf) * abs(direct) if travel else direct
        sign[:, j] = slid
    model, chi = kept.columns.model, kept.columns.model_chi(kept.chi, None)
    tau = model.torque(q, dq, ddq, chi, sign=sign)
    still = np.zeros_like(q)
    drives = np.array([name.startswith(("Fv", "Fc", "Off")) for name in model.parameters])
    friction = model.torque(q, dq, ddq, np.where(drives, chi, 0), sign=sign)
    weight = model.torque(q, still, still, np.where(drives, 0, chi))
    state = ctypes.create_string_buffer(256)
    for name, expected, given in (
        ("torque", tau, (q, dq, ddq)),
        ("friction", friction, (q, dq)),
        ("compensation", weight + friction, (q, dq)),
    ):
        library.arm_start(state)
        found = np.zeros((len(q), 7), real)
        for k in range(len(q)):
            rows = [np.ascontiguousarray(x[k], real) for x in given]
            pointers = [ctypes.c_void_p(row.ctypes.data) for row in (*rows, found[k])]
            getattr(library, f"arm_{name}")(state, *pointers)
        np.testing.assert_allclose(found, expected, atol=tolerance * np.abs(tau).max(), err_msg=name)
    assert np.abs(sign[:, 0] - np.sign(dq[:, 0])).max() > 0.5


def test_a_name_that_c_cannot_bear_is_refused(kept):
    with pytest.raises(ExportError, match="--name 3arm: give a C name"):
        c_code(kept, kept.load_robot(), "3arm")


EFFECTS = [
    {"effect": "stribeck_friction", "joint": 2, "Fs": 2.0, "vs": 0.2},
    {
        "effect": "torque_ripple",
        "joint": 3,
        "As": 1.0,
        "Ac": -0.5,
        "wavenumber": 9.0,
        "fixed": ["wavenumber"],
    },
    {"effect": "hysteresis", "joint": 4, "Fc": 3.0, "width": 0.02},
    {"effect": "load_dependent_friction", "joint": 2, "mu": 0.05, "Iam": 0.3, "own": 0.4, "own_offset": 0.7},
    {"effect": "maxwell_slip", "joint": 3, "Wa": 1.0, "Wb": 2.0, "Wc": 0.7, "width": 0.01},
    {"effect": "offset_drift", "joint": 5, "slope": 0.03},
    {"effect": "joint_coupling", "joint": 6, "source_joint": 5, "Fv": 0.4, "Ia": 0.1},
    {"effect": "time_delay", "joint": 1, "delay": 0.002},
    {"effect": "joint_elasticity", "joint": 1, "k": 2e4},
]


def with_effects(kept):
    """The fit as if its study had declared these effects and found these values."""
    pytest.importorskip("ident.equations.placing")
    from ident.equations.placing import layout_of, terms_of
    from ident.equations.terms import with_terms
    from ident.recordings.study import study_from

    data = kept.study.model_dump(mode="json", by_alias=True, exclude_none=True)
    study = study_from({**data, "effects": EFFECTS}, kept.study.file)
    terms = terms_of(study, kept.rigid, layout_of(study, kept.rigid, [4.0] * 7))
    columns = with_terms(kept.rigid, terms)
    chi = np.concatenate([kept.chi, *(term.at for term in terms)])
    covariance = np.eye(len(chi))
    return replace(kept, study=study, terms=terms, columns=columns, chi=chi, covariance=covariance)


@needs_compiler
@pytest.mark.parametrize(("float32", "tolerance"), [(False, 1e-12), (True, 1e-4)])
def test_effects_with_their_states(kept, tmp_path, float32, tolerance):
    from modelgen.effects.place import Motion

    fit = with_effects(kept)
    library = compiled(fit, tmp_path, float32)
    code = c_code(fit, fit.load_robot(), "arm", float32)
    left_out = {label.partition(":")[0]: reason for label, reason in code.left_out.items()}
    assert list(left_out) == ["time_delay", "joint_elasticity"]
    assert "what is recorded" in left_out["time_delay"] and "before and after" in left_out["joint_elasticity"]
    assert "ARM_stribeck_friction_2_Fs" in code.header and "_delay" not in code.header
    real = np.float32 if float32 else np.float64
    t, q, dq, ddq = (x.astype(real).astype(float) for x in motion(20, 50, 5))
    seen = Motion("new", None, t, q, dq, ddq, np.sign(dq), np.zeros_like(q), 50.0)
    fitted = replace(fit.fitted({}), terms=tuple(term for term in fit.terms if term.effect.kind == "column"))
    rigid = fit.rigid.model.torque(q, dq, ddq, fit.rigid.model_chi(fit.chi, None))
    found = fitted.chain().torque(seen)
    state = ctypes.create_string_buffer(256)
    library.arm_start(state)
    pointer, number = ctypes.c_void_p, ctypes.c_float if float32 else ctypes.c_double
    library.arm_torque.argtypes = [pointer, number, pointer, pointer, pointer, pointer]
    tau = np.zeros((len(t), 7), real)
    for k in range(len(t)):
        rows = [np.ascontiguousarray(x[k], real) for x in (q, dq, ddq)]
        library.arm_torque(state, float(t[k]), *(row.ctypes.data for row in rows), tau[k].ctypes.data)
    assert np.abs(found).max(axis=0)[[1, 2, 3, 4, 5]].min() > 0.1
    size = np.abs(rigid + found).max()
    np.testing.assert_allclose(tau, rigid + found, atol=tolerance * size)
