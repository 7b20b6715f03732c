"""Robot files: strict YAML in, a checked `Robot` out; every refusal is one sentence with its remedy."""

from __future__ import annotations

import difflib
import hashlib
import keyword
import re
from importlib.resources import files
from pathlib import Path
from typing import Any

import sympy as sp

from modelgen.errors import ExpressionError, ModelgenError, RobotFileError, shortened
from modelgen.geometry import plausible, strict_yaml, urdf
from modelgen.geometry.expressions import parse
from modelgen.geometry.labels import check_payload_label
from modelgen.geometry.robot import SIGMA, Limits, Link, Robot

MOST_LINKS = 64
LARGEST_FILE = 256 * 1024
ROBOT_KEYS = {"name", "convention", "gravity", "constants", "links", "payloads"}
LINK_KEYS = {"name", "joint", "antecedent", "gamma", "b", "alpha", "d", "theta", "r", "limits"}
NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\Z")
VARIABLE = re.compile(r"q[1-9][0-9]*\Z")
PARAMETER = re.compile(r"(XX|XY|XZ|YY|YZ|ZZ|MX|MY|MZ|M|Iam|Fvm|Fcm|Offm|Fvl|Fcl|Offl)[A-Z0-9]*\Z")


def built_in_names() -> tuple[str, ...]:
    """Names of the robots that come with the package."""
    robots = (Path(f.name) for f in files("modelgen").joinpath("robots").iterdir())
    return tuple(sorted(path.stem for path in robots if path.suffix in (".yaml", ".urdf")))


def load_robot(name_or_path: str | Path, exact: bool = False) -> Robot:
    """Read a built-in robot by name, or a robot file by path.

    `exact`: a URDF's angles and lengths as they are written, see urdf_mdh.py. Raises RobotFileError naming
    the file, the offending key and the remedy.
    """
    text = str(name_or_path)
    path = Path(text)
    if text in built_in_names() and not path.is_file():
        folder = files("modelgen").joinpath("robots")
        source = f"{text}.urdf" if folder.joinpath(f"{text}.urdf").is_file() else f"{text}.yaml"
        data = folder.joinpath(source).read_bytes()
    else:
        source = path.name or text
        try:
            data = strict_yaml.read(path, urdf.LARGEST_TEXT)
        except FileNotFoundError:
            raise RobotFileError(source, _not_found(text)) from None
        except ModelgenError as error:
            raise RobotFileError(text, f"{error}, or a built-in robot") from None
    return parse_robot(data, source, exact)


def _not_found(text: str) -> str:
    close = difflib.get_close_matches(Path(text).stem, built_in_names(), n=1, cutoff=0.5)
    hint = f"did you mean {close[0]}?" if close else f"built-in robots are {', '.join(built_in_names())}."
    return f"no such file and no built-in robot of this name; {hint}"


def parse_robot(data: bytes | str, source: str = "robot", exact: bool = False) -> Robot:
    """Check the text of a robot file and return the robot; `source` names it in errors."""
    data = data.encode() if isinstance(data, str) else data
    if urdf.is_urdf(data, source):
        return urdf.convert(data, source, exact).robot
    if len(data) > LARGEST_FILE:
        size = f"is larger than {LARGEST_FILE // 1024} KiB"
        raise RobotFileError(source, f"{size}; a robot file is a table of at most {MOST_LINKS} links")
    try:
        table = strict_yaml.load(data)
        return _robot(table, hashlib.sha256(data.replace(b"\r\n", b"\n")).hexdigest())
    except ModelgenError as error:
        raise RobotFileError(source, str(error)) from None


def _robot(table: Any, sha256: str) -> Robot:
    if not isinstance(table, dict):
        raise ModelgenError("is not a mapping; start it with name, convention, gravity and links")
    _check_keys(table, {"name", "convention", "gravity", "links"}, ROBOT_KEYS, "the robot file")
    name = table["name"]
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z0-9_.-]{1,80}", name) or name.startswith("."):
        raise ModelgenError(f"name is {_shown(name)}; use letters, digits, '_', '-' and '.'")
    if table["convention"] != "mdh":
        raise ModelgenError(
            f"convention is {_shown(table['convention'])}; only mdh (Khalil's modified Denavit-Hartenberg) "
            "is read"
        )
    constants = _constants(table.get("constants") or {})
    symbols: dict[str, sp.Expr] = {c: sp.Symbol(c, real=True) for c in constants}
    gravity = _gravity(table["gravity"], symbols, constants)
    rows = table["links"]
    if not isinstance(rows, list) or not rows:
        raise ModelgenError("links is not a list of rows; give one mapping per link")
    if len(rows) > MOST_LINKS:
        raise ModelgenError(f"has {len(rows)} links; at most {MOST_LINKS} are accepted")
    links = tuple(_link(row, j, len(rows), symbols, constants) for j, row in enumerate(rows, 1))
    _check_tree(links)
    _check_names(links)
    return Robot(name, gravity, links, constants, _payloads(table.get("payloads") or {}, len(links)), sha256)


def _shown(value: object) -> str:
    return shortened(repr(value))


def _check_keys(table: dict, required: set[str], known: set[str], where: str) -> None:
    for key in table:
        if key not in known:
            close = difflib.get_close_matches(str(key), known, n=1)
            hint = f"did you mean {close[0]}?" if close else f"known keys are {', '.join(sorted(known))}."
            raise ModelgenError(f"{where} has the unknown key {shortened(str(key))}; {hint}")
    for key in sorted(required - table.keys()):
        raise ModelgenError(f"{where} has no {key}; add the key {key}")


def _constants(table: Any) -> dict[str, sp.Expr]:
    if not isinstance(table, dict):
        raise ModelgenError("constants is not a mapping; write for example {rl3: 0.4}")
    constants = {}
    for name, value in table.items():
        if not isinstance(name, str) or not NAME.match(name) or keyword.iskeyword(name):
            raise ModelgenError(
                f"the constant {_shown(name)} is not an identifier; use letters, digits and '_'"
            )
        if name == "pi" or VARIABLE.match(name) or PARAMETER.match(name):
            raise ModelgenError(
                f"the constant {name} bears the name of pi, a joint variable or a parameter; rename it"
            )
        try:
            constants[name] = parse(value, {})
        except ExpressionError as error:
            raise ModelgenError(f"constant {name}: {error}") from None
    return constants


def _gravity(
    row: Any, symbols: dict[str, sp.Expr], constants: dict[str, sp.Expr]
) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    if not isinstance(row, list) or len(row) != 3:
        raise ModelgenError("gravity is not three numbers; write for example [0, 0, -9.81]")
    try:
        x, y, z = (parse(value, symbols) for value in row)
    except ExpressionError as error:
        raise ModelgenError(f"gravity: {error}") from None
    problem = plausible.gravity([_finite(value, constants, "gravity") for value in (x, y, z)])
    if problem:
        raise ModelgenError(f"gravity {problem}")
    return x, y, z


def _finite(value: sp.Expr, constants: dict[str, sp.Expr], where: str) -> float:
    number = value.xreplace({sp.Symbol(name, real=True): c for name, c in constants.items()})
    if not (number.is_finite and number.is_real):
        raise ModelgenError(f"{where} is not a finite number with the constants as they are; correct it")
    return float(number)


def _link(row: Any, j: int, count: int, symbols: dict[str, sp.Expr], constants: dict[str, sp.Expr]) -> Link:
    where = f"link {j}"
    if not isinstance(row, dict):
        raise ModelgenError(
            f"{where} is not a mapping; write {{joint: revolute, antecedent: {j - 1}, alpha: 0, ...}}"
        )
    _check_keys(row, {"joint", "antecedent", "alpha", "d", "theta", "r"}, LINK_KEYS, where)
    joint, antecedent = row["joint"], row["antecedent"]
    if not isinstance(joint, str) or joint not in SIGMA:
        raise ModelgenError(f"{where} has joint {_shown(joint)}; use revolute, prismatic or fixed")
    if isinstance(antecedent, bool) or not isinstance(antecedent, int) or not 0 <= antecedent <= count:
        raise ModelgenError(
            f"{where} has antecedent {_shown(antecedent)}; use 0 for the base or the number of another link"
        )
    name = row.get("name", f"link{j}")
    if not isinstance(name, str) or not name.strip() or len(name) > 80 or not name.isprintable():
        raise ModelgenError(f"{where} has the name {_shown(name)}; use a short text on one line")
    known = {**symbols, **{v: sp.Symbol(v, real=True) for v in _variables_in(row)}}
    values = {}
    for key in ("gamma", "b", "alpha", "d", "theta", "r"):
        try:
            values[key] = parse(row.get(key, 0), known)
        except ExpressionError as error:
            raise ModelgenError(f"{where}, {key}: {error}") from None
    variable = _take_variable(values, joint, j)
    for key, value in values.items():
        number = _finite(value, constants, f"{where}, {key}")
        problem = plausible.length(number) if key in ("b", "d", "r") else plausible.angle(number)
        if problem:
            raise ModelgenError(f"{where}, {key} {problem}")
    limits = _limits(row.get("limits"), where)
    if limits and (problem := plausible.limits(SIGMA[joint], limits.q, limits.dq)):
        raise ModelgenError(f"{where}, limits {problem}")
    return Link(name, joint, antecedent, variable=variable, limits=limits, **values)


def _variables_in(row: dict) -> set[str]:
    return {
        word
        for value in row.values()
        if isinstance(value, str)
        for word in re.findall(r"\w+", value)
        if VARIABLE.match(word)
    }


def _take_variable(values: dict[str, sp.Expr], joint: str, j: int) -> str | None:
    """Remove the joint variable from `values` in place and return its name; None on a fixed joint."""
    moving_key = {"revolute": "theta", "prismatic": "r", "fixed": ""}[joint]
    found: str | None = None
    for key, value in values.items():
        variables = [s for s in value.free_symbols if VARIABLE.match(str(s))]
        if variables and key != moving_key:
            remedy = f"only {moving_key} may" if moving_key else "a fixed joint has none"
            raise ModelgenError(f"link {j} is {joint}, but its {key} contains {variables[0]}; {remedy}")
        if len(variables) > 1:
            raise ModelgenError(f"link {j}, {key} contains {len(variables)} joint variables; keep one")
        if variables:
            rest = sp.expand(value - variables[0])
            if rest.has(variables[0]):
                raise ModelgenError(
                    f"link {j}, {key} must be {variables[0]} plus a constant; alpha reverses an axis"
                )
            values[key], found = rest, str(variables[0])
    if moving_key and found is None:
        raise ModelgenError(
            f"link {j} is {joint}, but its {moving_key} contains no joint variable; write {moving_key}: q{j}"
        )
    return found


def _limits(table: Any, where: str) -> Limits | None:
    if table is None:
        return None
    if isinstance(table, list):
        table = {"q": table}
    remedy = "write limits: {q: [lo, hi], dq: speed, ddq: acceleration, tau: torque} in SI units"
    if not isinstance(table, dict) or table.keys() - {"q", "dq", "ddq", "tau"}:
        raise ModelgenError(f"{where}, limits is {_shown(table)}; {remedy}")
    try:
        scalars = {k: float(parse(table[k], {})) for k in ("dq", "ddq", "tau") if k in table}
        interval = None
        if "q" in table:
            lo, hi = (float(parse(x, {})) for x in table["q"])
            interval = (lo, hi)
    except (ExpressionError, TypeError, ValueError):  # ValueError: not two of them
        raise ModelgenError(f"{where}, limits is {_shown(table)}; {remedy}") from None
    if (interval and interval[0] >= interval[1]) or any(v <= 0 for v in scalars.values()):
        raise ModelgenError(f"{where}, limits is {_shown(table)}; lo must be below hi and the rest positive")
    return Limits(q=interval, **scalars)


def _check_tree(links: tuple[Link, ...]) -> None:
    for j in range(1, len(links) + 1):
        way, row = [j], links[j - 1].antecedent
        while row and row not in way:
            way.append(row)
            row = links[row - 1].antecedent
        if row:
            loop = way[way.index(row) :]
            raise ModelgenError(
                f"the antecedents of links {', '.join(map(str, sorted(loop)))} form a cycle; lead each to 0"
            )
    for j, link in enumerate(links, 1):
        if link.antecedent > j:
            raise ModelgenError(
                f"link {j} comes before its antecedent {link.antecedent}; list a link after its antecedent"
            )
    variables = [link.variable for link in links if link.variable]
    for v in variables:
        if variables.count(v) > 1:
            raise ModelgenError(
                f"the joint variable {v} is used by {variables.count(v)} links; give each its own"
            )
    if not variables:
        raise ModelgenError("has no moving joint; give at least one link joint: revolute or prismatic")
    by_row = [f"q{j}" for j, link in enumerate(links, 1) if link.variable]
    by_order = [f"q{k}" for k in range(1, len(variables) + 1)]
    if variables not in (by_row, by_order):
        raise ModelgenError(
            f"its joint variables are {', '.join(variables)}; number them {', '.join(by_order)} in order"
        )


def _check_names(links: tuple[Link, ...]) -> None:
    first: dict[str, int] = {}
    for j, link in enumerate(links, 1):
        if link.name in first:
            raise ModelgenError(
                f"links {first[link.name]} and {j} are both named {link.name}; give each its own name"
            )
        first[link.name] = j


def _payloads(table: Any, count: int) -> dict[str, int]:
    if not isinstance(table, dict):
        raise ModelgenError("payloads is not a mapping; write for example {L: 7}")
    for label, link in table.items():
        check_payload_label(label)
        if isinstance(link, bool) or not isinstance(link, int) or not 1 <= link <= count:
            raise ModelgenError(
                f"payload {label} is fixed to link {_shown(link)}; name a link from 1 to {count}"
            )
    return dict(table)
