"""CasADi functions -> one C99 file per model, for a controller and (compiled for vectors) for batches.

The bodies are CasADi's. Around them stand the functions a controller calls, which take q and find cos and
sin with libm. `REAL`, `CONSTANT`, `OUTPUT` and `STORE` are plain doubles here; see `generated/vector.h`.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from typing import Any

import casadi as ca
import sympy as sp

from modelgen.emit.casadi_functions import STATE, inner_functions
from modelgen.emit.description import Derived

LONGEST_NAME = 100  # characters
GENERATOR = "1"  # version of what is emitted; raise it when the text changes


def provenance(robot_sha256: str) -> dict[str, str]:
    """What the generated files were made of; no date and no path, so that two runs agree."""
    return {
        "robot_sha256": robot_sha256,
        "generator": GENERATOR,
        "casadi": str(ca.CasadiMeta.version()),
        "sympy": sp.__version__,
    }


def described(derived: Derived, made_of: Mapping[str, str]) -> dict[str, Any]:
    """The description as it is written beside the C."""
    return {**derived.description, "prefix": prefix(derived.description), "made_of": dict(made_of)}


def prefix(description: Mapping[str, Any]) -> str:
    """Start of the C names of a model: robot, model, payload, effects."""
    name = re.sub(r"\W", "_", f"{description['robot']}_{file_stem(description)}")
    return f"robot_{name}" if name[0].isdigit() else name


def file_stem(description: Mapping[str, Any]) -> str:
    """Name of a model's files without suffix: A, A_L, A_stribeck_friction_2; of many effects the first ones
    and a digest, because file systems limit it."""
    parts = [description["model"], description["payload"] or "", *description["effects"]]
    name = re.sub(r"\W", "_", "_".join(part for part in parts if part))
    return (
        name if len(name) <= LONGEST_NAME else f"{name[:60]}_{hashlib.sha256(name.encode()).hexdigest()[:8]}"
    )


def body(function: ca.Function) -> list[str]:
    """Statements of CasADi's C for `function`, with the macros of a model's file in place of its own names.

    Raises AssertionError if CasADi writes a statement of a form that is not known here.
    """
    generator = ca.CodeGenerator("model.c")
    generator.add(function)
    text = generator.dump()
    start = text.index("static int casadi_f0")
    lines = text[start : text.index("\n}\n", start)].split("\n")[1:]
    names = function.name_in()
    statements = []
    for line in (line.strip() for line in lines):
        if line == "return 0;" or not line:
            continue
        if line.startswith("casadi_real "):
            statements.append(line.replace("casadi_real", "REAL", 1))
        elif re.fullmatch(r"(casadi_real )?a\d+(, a\d+)*[,;]", line):
            statements.append("  " + line)
        elif found := re.fullmatch(r"(\w+)=arg\[(\d+)\]\? arg\[\d+\]\[(\d+)\] : 0;", line):
            name, index = names[int(found[2])], found[3]
            value = f"CONSTANT({name}[{index}])" if name == "chi" else f"{name}[{index}]"
            statements.append(f"{found[1]} = {value};")
        elif found := re.fullmatch(r"if \(res\[0\]!=0\) res\[0\]\[(\d+)\]=(\w+);", line):
            statements.append(f"STORE({function.name_out(0)}, {found[1]}, {found[2]});")
        elif found := re.fullmatch(r"(a\d+)=(.+);", line):
            statements.append(f"{found[1]} = {_expression(found[2])};")
        else:
            raise AssertionError(f"a statement of CasADi's that is not known here: {line}")
    return statements


def _expression(text: str) -> str:
    if re.fullmatch(r"-?[\d.]+(e[+-]\d+)?", text):
        return f"CONSTANT({text})"
    if found := re.fullmatch(r"casadi_sq\((a\d+)\)", text):
        return f"({found[1]}*{found[1]})"
    if found := re.fullmatch(r"\(2\.\*\s*(a\d+)\)", text):
        return f"({found[1]}+{found[1]})"
    if re.fullmatch(r"\(-?a\d+([-+*/]a\d+)?\)", text):
        return text
    if found := re.fullmatch(r"(exp|sin|cos|tanh|fabs|sqrt|casadi_sign|casadi_fabs)\(\s*(a\d+)\s*\)", text):
        return f"CALL_{found[1].removeprefix('casadi_').removeprefix('f')}({found[2]})"
    if found := re.fullmatch(r"pow\((a\d+),(a\d+)\)", text):
        return f"CALL_pow({found[1]}, {found[2]})"
    raise AssertionError(f"an expression of CasADi's that is not known here: {text}")


_ARGUMENTS = ", ".join(f"const REAL *{name}" for name in STATE)

_MACROS = """\
#ifndef REAL /* plain numbers; for vectors these come from outside */
#define REAL double
#define CONSTANT(x) (x)
#define OUTPUT double *
#define STORE(W, k, x) ((W)[k] = (x))
#define CALL_exp(x) exp(x)
#define CALL_sin(x) sin(x)
#define CALL_cos(x) cos(x)
#define CALL_tanh(x) tanh(x)
#define CALL_abs(x) fabs(x)
#define CALL_sqrt(x) sqrt(x)
#define CALL_sign(x) ((double)(((x) > 0) - ((x) < 0)))
#define CALL_pow(x, y) pow(x, y)
#define PLAIN
#endif
"""

_END = """\
#undef REAL
#undef CONSTANT
#undef OUTPUT
#undef STORE
#undef CALL_exp
#undef CALL_sin
#undef CALL_cos
#undef CALL_tanh
#undef CALL_abs
#undef CALL_sqrt
#undef CALL_sign
#undef CALL_pow
#undef PLAIN
#endif
"""


def source(derived: Derived, made_of: Mapping[str, str]) -> str:
    """The C file of a model."""
    d = derived.description
    name = prefix(d)
    functions = inner_functions(derived)
    n, b, channels = len(d["joints"]), len(d["parameters"]), len(d["channels"])
    columns = _inner(f"{name}_columns", functions["columns"], "OUTPUT W", "W")
    torque = _inner(f"{name}_inverse_dynamics", functions["torque"], "const double *chi, OUTPUT tau", "tau")
    parts = [
        _banner(d, made_of),
        "#include <math.h>\n",
        _MACROS,
        "/* The entries of W that differ from each other; c = cos q, s = sin q, sign = sign(dq). */",
        columns,
        "/* One torque per channel; chi as in the header's list. */",
        torque,
        f'#ifdef PLAIN\n#include <string.h>\n#include "{file_stem(d)}.h"\n',
        _controller(d, name, n, b, channels),
        _END,
    ]
    return "\n".join(parts)


def _inner(name: str, function: ca.Function, last: str, output: str) -> str:
    statements = "\n".join("  " + statement for statement in body(function))
    unused = " ".join(f"(void){x};" for x in (*STATE, "extra", output, *(["chi"] if "chi" in last else [])))
    return (
        f"static inline void {name}({_ARGUMENTS},\n    const REAL *extra, {last})\n{{\n{statements}\n"
        f"  {unused}\n}}\n"
    )


def _banner(d: Mapping[str, Any], made_of: Mapping[str, str]) -> str:
    W, tau = d["operations"], d["operations"]["torque"]
    payload = f", payload {d['payload']}" if d["payload"] else ""
    effects = f", effects {', '.join(d['effects'])}" if d["effects"] else ""
    return f"""\
/* {d["robot"]}, model {d["model"]}{payload}{effects}: regressor and torque.
   Written by regenerate-model; do not edit.

   robot file sha256: {made_of["robot_sha256"]}
   generator {made_of["generator"]}, CasADi {made_of["casadi"]}, SymPy {made_of["sympy"]}
   given cos and sin, inertial entries of W: {W["add"]} additions, {W["mul"]} multiplications;
   torque, with friction: {tau["add"]} additions, {tau["mul"]} multiplications
*/
"""


def _controller(d: Mapping[str, Any], name: str, n: int, b: int, channels: int) -> str:
    extra = ", const double *extra" if d["extra_inputs"] else ""
    given = "extra" if d["extra_inputs"] else "0"
    prismatic = [joint["prismatic"] for joint in d["joints"]]
    state = "\n".join(
        f"  c[{i}] = {'1' if p else f'cos(q[{i}])'}; s[{i}] = {'0' if p else f'sin(q[{i}])'}; "
        f"sign[{i}] = CALL_sign(dq[{i}]);"
        for i, p in enumerate(prismatic)
    )
    entries = "\n".join(
        f"  W[{channel * b + parameter}] = {_source(source)};" for channel, parameter, source in d["nonzeros"]
    )
    head = f"const double q[{n}], const double dq[{n}], const double ddq[{n}]"
    return f"""\
void {name}_regressor({head}{extra}, double W[{channels * b}])
{{
  double c[{n}], s[{n}], sign[{n}], entry[{max(d["columns"], 1)}];
{state}
  {name}_columns(c, s, q, dq, ddq, sign, {given}, entry);
  memset(W, 0, {channels * b} * sizeof(double));
{entries}
  (void)entry;
}}

void {name}_torque({head}{extra}, const double chi[{b}], double tau[{channels}])
{{
  double c[{n}], s[{n}], sign[{n}];
{state}
  {name}_inverse_dynamics(c, s, q, dq, ddq, sign, {given}, chi, tau);
}}
"""


def _source(source: int | str) -> str:
    if isinstance(source, int):
        return f"entry[{source}]"
    if source == "one":
        return "1"
    signal = source.rstrip("0123456789")
    return f"{signal}[{source[len(signal) :]}]"


def header(derived: Derived, made_of: Mapping[str, str]) -> str:
    """The C header of a model: two functions, and what the numbers in W, chi and tau are."""
    d = derived.description
    name = prefix(d)
    n, b, channels = len(d["joints"]), len(d["parameters"]), len(d["channels"])
    guard = f"{name.upper()}_H"
    extra = ", const double *extra" if d["extra_inputs"] else ""
    state = f"const double q[{n}], const double dq[{n}], const double ddq[{n}]{extra}"
    listed = "\n".join(
        f"   {i:3} {p}" + (f" = {d['rules'][p]}" if d["rules"].get(p, p) != p else "")
        for i, p in enumerate(d["parameters"])
    )
    extras = "".join(f"   extra[{i}] {e}\n" for i, e in enumerate(d["extra_inputs"]))
    return f"""\
{_banner(d, made_of)}
#ifndef {guard}
#define {guard}

#define {name.upper()}_JOINTS {n}
#define {name.upper()}_CHANNELS {channels}
#define {name.upper()}_PARAMETERS {b}

/* q in rad (m), dq in rad/s, ddq in rad/s^2. W: {channels} x {b}, row after row; tau in N m (N).
   Rows: {", ".join(d["channels"])}.
{_names(d)}{extras}   Parameters chi:
{listed}
*/
#ifdef __cplusplus
extern "C" {{
#endif
void {name}_regressor({state}, double W[{channels * b}]);
void {name}_torque({state}, const double chi[{b}], double tau[{channels}]);
#ifdef __cplusplus
}}
#endif

#endif
"""


def _names(d: Mapping[str, Any]) -> str:
    """A line of the joints' own names, which may be any text of a URDF but no end of a comment."""
    named = [f"q{joint['label']} {joint['name']}" for joint in d["joints"] if "name" in joint]
    return f"   Joints: {', '.join(named)}.\n".replace("*", "_") if named else ""
