"""Confusion matrix of `ident diagnose` over simulations that share no code with it.

    python benchmarks/confusion_matrix.py --quick
    python benchmarks/confusion_matrix.py --per-effect 5 --clean 40 --pairs 30 --results /tmp/exam_results

Cases are drawn, written to a temporary folder, diagnosed in a process of their own (one BLAS thread, a time
limit) and removed; answers are kept in the results folder, so that a broken run goes on where it stopped. The
table at the end holds every measure of the issue beside its target.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from benchmarks.exam import draw
from benchmarks.exam.make_cases import KINDS, WITHOUT_EFFECTS, make_case, plan
from benchmarks.exam.scoring import Mark, score

TIME_LIMIT_S = 240


def diagnose_one(study_path: Path, answer: Path) -> None:
    """Run in a process of its own: the diagnosis of one study, and the time it took after imports."""
    from ident.diagnosis import diagnose_study
    from ident.diagnosis.document import diagnosis_document
    from ident.recordings.study import load_study

    begin, busy = time.perf_counter(), time.process_time()
    diagnosis: Any = diagnose_study(load_study(study_path))
    took, busy = time.perf_counter() - begin, time.process_time() - busy
    document = diagnosis_document(diagnosis)
    answer.write_text(json.dumps({"seconds": took, "cpu_seconds": busy, "document": document}, default=float))


def examine(study_path: Path, limit: float = TIME_LIMIT_S) -> dict[str, Any]:
    """The answer to one study, or the error that came instead of it."""
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "answer.json"
        command = [sys.executable, __file__, "--one", str(study_path), str(answer)]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=limit, check=False)
        except subprocess.TimeoutExpired:
            return {"error": f"no answer after {limit:.0f} s"}
        if done.returncode or not answer.exists():
            return {"error": done.stderr[-3000:] or f"exit status {done.returncode}"}
        return json.loads(answer.read_text())


def run_plan(todo: list[tuple[str, list[str], int]], a: argparse.Namespace) -> list[dict[str, Any]]:
    """Every planned case with its truth and answer, from the results folder where it is there already."""
    out = []
    a.results.mkdir(parents=True, exist_ok=True)
    for k, (kind, names, seed) in enumerate(todo):
        case = f"{kind}_{'+'.join(names).replace(':', '-') or 'none'}_{seed}"
        stored = a.results / f"{case}.json"
        if stored.exists():
            out.append(json.loads(stored.read_text()))
            continue
        if a.summary:
            continue
        keep = a.keep / case if a.keep else None
        with tempfile.TemporaryDirectory() as scratch:
            folder = keep or Path(scratch)
            told = folder / "truth" / f"{case}.json"
            if told.exists():
                truth: dict[str, Any] | None = json.loads(told.read_text())
            else:
                truth = make_case(kind, names, seed, case, folder, a.seconds, a.hz, "")
            if truth is None:
                continue  # the effect cannot show on what was drawn
            result = {"truth": truth} | examine(folder / "cases" / case / "study.yaml", a.limit)
        out.append(result)
        if "error" in result:  # not kept: the next run tries again
            line = "ERROR " + result["error"].strip().splitlines()[-1][:150]
        else:
            temporary = stored.with_suffix(".part")
            temporary.write_text(json.dumps(result))
            os.replace(temporary, stored)
            mark = score(truth, result["document"])
            good = verdict_of(truth, mark)
            line = f"{'ok  ' if good else 'MISS'} {mark.answer[:150]} ({result['cpu_seconds']:.1f} s)"
        print(f"[{k + 1}/{len(todo)}] {case} {truth['robot']} {truth['model']}: {line}", flush=True)
    return out


def verdict_of(truth: dict[str, Any], mark: Mark) -> bool:
    """Right in the sense of the issue's first measures."""
    if truth["kind"] == "clean":
        return mark.silent
    if truth["kind"] == "outside":
        return bool(mark.unexplained_right)
    if truth["kind"] == "pair":
        return mark.named >= mark.put_in and not mark.false
    if truth["kind"] == "twice":
        return mark.each and not mark.false
    return bool(mark.first_right) and not mark.false


def label_of(truth: dict[str, Any]) -> str:
    return "+".join(truth["names"]) or "clean"


def detectable(truth: dict[str, Any]) -> bool | None:
    """Whether the fit that knows lowers some joint's held-out error by 2 %; None without held-out data."""
    oracle = truth["oracle"]
    if "true_validate_percent" not in oracle:
        return None
    rigid, known = (np.array(oracle[f"{k}_validate_percent"]) for k in ("rigid", "true"))
    return bool(np.max(1 - known / rigid) > 0.02)


def floor_ratios(truth: dict[str, Any], document: dict[str, Any]) -> list[float]:
    """Of every channel the noise floor that was told over the noise that was put in, both after 10 Hz. (A fit
    that knows the truth leaves more: its dry friction turns over within one width.)"""
    floor, noise = document.get("noise_floor_percent", {}), truth.get("noise_percent", [])
    names = [
        n for n in document.get("error_percent", {}).get("before", {}).get("identify", {}) if n != "total"
    ]
    if len(names) != len(noise):
        return []
    return [floor.get(name, np.nan) / its for name, its in zip(names, noise) if its]


def _share(values: list[bool]) -> str:
    return f"{100 * np.mean(values):5.1f} % of {len(values)}" if values else "    -"


def report(results: list[dict[str, Any]]) -> str:
    """The matrix and the measures as text."""
    lines: list[str] = []
    answered = [r for r in results if "document" in r]
    broken = [r for r in results if "document" not in r]
    marks = [(r["truth"], score(r["truth"], r["document"]), r) for r in answered]
    names = [*draw.CATALOGUE, *WITHOUT_EFFECTS]
    singles = [(t, m, r) for t, m, r in marks if t["kind"] == "single"]
    lines.append("effect put in                 cases right effect false  answered instead (first finding)")
    for name in names:
        mine = [(t, m, r) for t, m, r in singles if t["names"] == [name]]
        if not mine:
            continue
        wrong: Counter[str] = Counter()
        for _t, m, r in mine:
            if not m.first_right:
                findings = r["document"].get("findings") or []
                wrong[findings[0]["effect"] if findings else r["document"].get("verdict", "?")] += 1
            for f in m.false[1 if not m.first_right else 0 :]:
                wrong["+" + f.split(":")[0]] += 1
        lines.append(
            f"{name:29s} {len(mine):5d} {sum(bool(m.first_right) for _, m, _ in mine):5d} "
            f"{sum(bool(m.first_effect_right) for _, m, _ in mine):6d} "
            f"{sum(len(m.false) for _, m, _ in mine):5d}  "
            + ", ".join(f"{k} {v}" for k, v in wrong.most_common())
        )
    lines.append("")
    for kind in ("outside", "pair", "twice", "weak", "noisy", "clean"):
        group: dict[str, list[str]] = defaultdict(list)
        for t, m, _ in marks:
            if t["kind"] == kind and not verdict_of(t, m):
                known = detectable(t)
                note = "" if kind not in ("weak", "noisy") or known else " [not detectable]"
                group[label_of(t)].append(m.answer[:90] + note)
        for name, answers in sorted(group.items()):
            lines += [f"{kind} {name}: {answer}" for answer in answers]
    lines.append("")

    def row(text: str, value: str, target: str) -> None:
        lines.append(f"{text:62s} {value:>18s}   target {target}")

    of_kind = {k: [(t, m, r) for t, m, r in marks if t["kind"] == k] for k in KINDS}
    row("single: right effect and joint first", _share([bool(m.first_right) for _, m, _ in singles]), "97 %")
    missed = [m for _, m, _ in singles if not m.first_right]
    row("  misses whose alternatives name it", _share([m.in_alternatives for m in missed]), "-")
    extra = [len([f for f in m.false if f]) - (not m.first_right and not m.silent) for _, m, _ in singles]
    row("single: further false findings a case", f"{np.mean(extra):.3f}" if extra else "-", "0.1")
    row("clean with nothing named", _share([m.silent for _, m, _ in of_kind["clean"]]), "98 %")
    verdicts = [r["document"].get("verdict") == "none" for _, _, r in of_kind["clean"]]
    row("  clean with the verdict none", _share(verdicts), "-")
    outside = of_kind["outside"]
    row(
        "outside: unexplained on the joint, no culprit",
        _share([bool(m.unexplained_right) for _, m, _ in outside]),
        "90 %",
    )
    strict = [bool(m.unexplained_right) for t, m, _ in outside if t["names"][0] not in draw.COVERABLE]
    row("  without those a catalogue may own", _share(strict), "-")
    row("pairs: both named", _share([m.named >= m.put_in for _, m, _ in of_kind["pair"]]), "85 %")
    row(
        "pairs: false findings a case",
        f"{np.mean([len(m.false) for _, m, _ in of_kind['pair']]):.3f}" if of_kind["pair"] else "-",
        "0.1",
    )
    row("twice: both named", _share([m.each for _, m, _ in of_kind["twice"]]), "all")
    for kind in ("weak", "noisy"):
        able = [bool(m.first_right) for t, m, _ in of_kind[kind] if detectable(t)]
        row(f"{kind}: right among those a fit of the truth shows held out", _share(able), "100 %")
        row(
            f"{kind}: false findings a case",
            f"{np.mean([len(m.false) for _, m, _ in of_kind[kind]]):.3f}" if of_kind[kind] else "-",
            "-",
        )
    ratios, floor = [], []
    for t, m, r in [*singles, *of_kind["pair"]]:
        after = (r["document"].get("error_percent") or {}).get("after", {}).get("validate", {}).get("total")
        before = (r["document"].get("error_percent") or {}).get("before", {}).get("validate", {}).get("total")
        known = t["oracle"].get("true_validate_total_percent")
        if after and known:
            ratios.append(after / known)
            if before and m.first_right:
                floor.append((after / before) / (known / t["oracle"]["rigid_validate_total_percent"]))
    row("validate error / fit of the truth: median", f"{np.median(ratios):.3f}" if ratios else "-", "-")
    row("  within 10 %", _share([x <= 1.10 for x in ratios]), "all")
    row("  drop relative to the drop of the truth, within 10 %", _share([x <= 1.10 for x in floor]), "-")
    floors = [x for t, _, r in marks for x in floor_ratios(t, r["document"])]
    middle = f"{np.median(floors):.2f}" if floors else "-"
    row("noise floor / the noise that was put in: median", middle, "-")
    row("  within 20 %", _share([abs(x - 1) <= 0.2 for x in floors]), "all")
    errors = [(n, e) for _, m, _ in singles for n, e in m.parameter_errors]
    row(
        "parameters: median relative error",
        f"{100 * np.median([e for _, e in errors]):.2f} %" if errors else "-",
        "2 %",
    )
    row(
        "parameters: 95 % intervals that cover",
        _share([c for _, m, _ in singles for _, c in m.covered]),
        "90 %",
    )
    seconds = [r["seconds"] for r in answered]
    if seconds:
        row(
            "time a case: median / worst (1 core)",
            f"{np.median(seconds):.1f} / {max(seconds):.1f} s",
            "20 s on 2 cores",
        )
    row("answers / crashes or time-outs", f"{len(answered)} / {len(broken)}", "0 crashes")
    lines.append("")
    by_name: dict[str, list[float]] = defaultdict(list)
    for n, e in errors:
        by_name[n].append(e)
    cover: dict[str, list[bool]] = defaultdict(list)
    for _, m, _ in singles:
        for n, c in m.covered:
            cover[n].append(c)
    lines.append("parameter: median error, intervals that cover")
    for n, e in sorted(by_name.items()):
        lines.append(f"  {n:38s} {100 * float(np.median(e)):7.2f} %   {sum(cover[n])} of {len(cover[n])}")
    for r in broken:
        lines.append(
            f"BROKEN {label_of(r['truth'])} {r['truth']['case']}: {r['error'].strip().splitlines()[-1][:160]}"
        )
    return "\n".join(lines)


def main() -> None:
    if len(sys.argv) == 4 and sys.argv[1] == "--one":
        diagnose_one(Path(sys.argv[2]), Path(sys.argv[3]))
        return
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=100)
    parser.add_argument("--results", type=Path, default=Path(tempfile.gettempdir()) / "dynident_exam")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--effects", nargs="+", help="names of contract 7, without:NAME, or outside names")
    parser.add_argument("--per-effect", type=int, default=5)
    parser.add_argument("--clean", type=int, default=40)
    parser.add_argument("--pairs", type=int, default=30)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--hz", type=float, help="one rate for all cases")
    parser.add_argument("--limit", type=float, default=TIME_LIMIT_S, help="seconds of one diagnosis")
    parser.add_argument("--keep", type=Path, help="keep the recordings of the cases here")
    parser.add_argument(
        "--quick", action="store_true", help="one seed an effect, five clean runs, 30 s at 250 Hz"
    )
    parser.add_argument("--summary", action="store_true", help="only the table of what is there already")
    a = parser.parse_args()
    if a.quick:
        a.per_effect, a.clean, a.pairs, a.seconds, a.hz = 1, 5, 3, 30.0, 250.0
        a.results = a.results / "quick"
    todo = plan(a.seed, a.kinds, a.effects, a.per_effect, a.clean, a.pairs)
    text = report(run_plan(todo, a))
    (a.results / "matrix.txt").write_text(text + "\n")
    print(text)


if __name__ == "__main__":
    main()
