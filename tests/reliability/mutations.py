"""Mutations of a table of keys (a robot file, a study) as hypothesis strategies: failures shrink by themselves."""

# ruff: noqa: E501  (tables of odd values, a line each)
from __future__ import annotations

import copy
import json
from collections.abc import Callable, Sequence
from typing import Any

from hypothesis import strategies as st

from tests.reliability.judge import Case

Tree = dict[str, Any]
Planted = Sequence[tuple[str, Callable[[Tree], Any]]]  # name, change of a good tree (or a whole text)

VALUES: tuple[Any, ...] = (
    None, True, False, 0, 1, -1, 2, 3, 64, 65, 90, 0.1, -0.5, 1e6, 1e300, -1e300, 1e-300, 10**400,
    float("nan"), float("inf"), float("-inf"), "", " ", "a", "a" * 5000, "é", "日本", "$HOME", "${NO_SUCH}/a",
    "${A:-b}", "$(ls)", "~", "~nobody/x", "\x00", "a\nb", "a\tb", "../../x", "/dev/zero", "/dev/stdin", "/",
    [], {}, [[]], [1, 2], [0, 0, -9.81], [1, "a", None], [1e300] * 3, {"a": 1}, {"column": 1}, [{}], [None] * 3,
    "nan", "inf", "1e999", "1e3", "9**9**9", "((2**8)**8)**8", "2**8", "pi", "pi*pi", "pi/2", "-pi/3", "1/0",
    "1/pi", "pi**8", "q1", "q2 - pi/2", "q9", "-q1", "q1*2", "q1 + pi/7", "cos(1)", "__import__('os')",
    "rl3", "rl3**8", "1/(rl3 - 0.4)", "rl3*pi", "rl3/rl3", "0x10", "1_000", "12:30", "2001-01-01", "yes", "M",
    "L", "X1", "LR", "auto", "identify", "validate", "revolute", "prismatic", "fixed", "mdh", "A", "B", "C", "D",
    "0.3", "1.5708", "-" * 50 + "1", "(" * 60 + "1" + ")" * 60, "+".join(["1"] * 90), "1e-11", "999999999999",
)  # fmt: skip
TOKENS = (
    "&a ", "*a", "<<: ", "? ", "!!timestamp ", "!!bool ", "!!int ", "!!set ", "!!binary ", "!!python/none ",
    "\t", "\x00", "---\n", "...\n", "{", "}", "[", "]", "- ", ": ", ",", "#", "|", ">", "\ufeff", "%YAML 9\n",
    "'", '"', "\\u", "\n", "\r", "é", "\U0001f916", "=", "@", "`", ".inf", ".nan", "1e", "0o9", "::",
)  # fmt: skip


@st.composite
def mutated(
    draw: st.DrawFn, bases: Callable[[], Sequence[Tree]], planted: Callable[[], Planted], keys: Sequence[str]
) -> Case:
    """One of `bases` with one to three changes, garbled text now and then; or with a defect planted."""
    tree = copy.deepcopy(draw(st.sampled_from(bases())))
    what = draw(st.sampled_from(("tree", "tree", "text", "planted", "planted")))
    if what == "planted":
        name, change = draw(st.sampled_from(planted()))
        made = change(tree)
        return Case(made if isinstance(made, bytes) else text_of(tree if made is None else made), name)
    for _ in range(draw(st.integers(1, 3)) if what == "tree" else draw(st.integers(0, 1))):
        _change(draw, tree, keys)
    data = text_of(tree)
    return Case(_garbled(draw, data) if what == "text" else data)


def text_of(tree: Any) -> bytes:
    """YAML, by way of JSON, which is quicker to write."""
    text = json.dumps(tree, ensure_ascii=False)
    for json_word, yaml_word in (("-Infinity", "-.inf"), ("Infinity", ".inf"), ("NaN", ".nan")):
        text = text.replace(json_word, yaml_word)
    return text.encode("utf-8", "surrogatepass")


def _places(tree: Any) -> list[tuple[Any, Any]]:
    found: list[tuple[Any, Any]] = []
    inner = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for key, value in inner:
        found.append((tree, key))
        found += _places(value)
    return found


def _change(draw: st.DrawFn, tree: Tree, keys: Sequence[str]) -> None:
    places = _places(tree)
    if not places:
        return
    owner, key = places[draw(st.integers(0, len(places) - 1))]
    value = owner[key]
    action = draw(
        st.sampled_from(("value", "value", "value", "scale", "remove", "rename", "add", "double", "swap"))
    )
    if action == "value":
        owner[key] = copy.deepcopy(draw(st.sampled_from(VALUES)))
    elif action == "scale" and isinstance(value, int | float) and abs(value) < 1e300:
        owner[key] = value * draw(st.sampled_from((-1, 0, 10, 1000, 1e-3, 57.2957795, 1e12)))
    elif action == "remove":
        del owner[key]
    elif action == "rename" and isinstance(owner, dict):
        owner[draw(st.sampled_from(("", "x", f"{key}s", str(key).upper(), *keys)))] = owner.pop(key)
    elif action == "add" and isinstance(owner, dict):
        owner[draw(st.sampled_from(keys))] = copy.deepcopy(draw(st.sampled_from(VALUES)))
    elif action == "double" and isinstance(owner, list):
        owner.insert(key, copy.deepcopy(value))
    elif action == "swap" and isinstance(owner, list):
        other = draw(st.integers(0, len(owner) - 1))
        owner[key], owner[other] = owner[other], owner[key]


def _garbled(draw: st.DrawFn, data: bytes) -> bytes:
    for _ in range(draw(st.integers(1, 3))):
        place = draw(st.integers(0, len(data)))
        action = draw(st.sampled_from(("token", "cut", "drop", "bytes", "repeat")))
        if action == "token":
            data = data[:place] + draw(st.sampled_from(TOKENS)).encode() + data[place:]
        elif action == "cut":
            data = data[:place]
        elif action == "drop":
            data = data[:place] + data[place + draw(st.integers(1, 40)) :]
        elif action == "bytes":
            data = data[:place] + draw(st.binary(min_size=1, max_size=4)) + data[place:]
        else:
            data = data[:place] + data[max(0, place - draw(st.integers(1, 60))) : place] + data[place:]
    return data
