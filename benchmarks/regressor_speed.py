"""Speed of regressor and torque beside Pinocchio's C++ in a compiled loop; same run, same arrays, medians.

    python benchmarks/regressor_speed.py [--samples 90000] [--repeats 15] [--json]

Needs the `bench` extra (pin; its C++ headers come with the wheel), a C++ compiler and Eigen
(libeigen3-dev, or the headers in CasADi's wheel).
The rounds of all contestants are interleaved, so that a noisy machine is noisy for all of them.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import shutil
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import generated
from generated import cache, compiling
from generated.blocks import BLOCK, zero_rows
from generated.kernel import Kernel, Placement, Samples

os.environ.setdefault("OMP_WAIT_POLICY", "passive")  # Pinocchio's idle thread would spin in its rivals' turns
HERE = Path(__file__).parent
PEER_FLAGS = (
    *("-std=c++17", "-O3", "-march=native", "-DNDEBUG", "-w", "-shared", "-fPIC", "-fopenmp"),
    *("-DBOOST_FUSION_INVOKE_MAX_ARITY=10", "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS"),
    *("-DBOOST_MPL_LIMIT_LIST_SIZE=30", "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30"),
)
JOINTS, ROBOT = 7, "kuka_lwr4p"
TURNS = 5  # of one thread between two looks at the clock


def peer_library() -> ctypes.CDLL:
    """Pinocchio's loops, compiled once (a minute) and cached."""
    import casadi
    import pinocchio

    compiler = os.environ.get("CXX") or shutil.which("c++") or shutil.which("g++")
    shipped = Path(casadi.__file__).parent / "include" / "eigen3"  # CasADi's wheel brings the headers
    places = ("/usr/include/eigen3", "/usr/local/include/eigen3", shipped)
    eigen = next((str(p) for p in places if Path(p).is_dir()), None)
    if compiler is None or eigen is None:
        sys.exit("the comparison needs a C++ compiler and Eigen: apt-get install g++ libeigen3-dev")
    prefix = next(p for p in Path(pinocchio.__file__).parents if p.name == "cmeel.prefix")
    source = (HERE / "pinocchio_peer.cpp").read_text()

    def build(place: Path) -> None:
        (place / "peer.cpp").write_text(source)
        print("compiling Pinocchio's loop: a minute, once ...", file=sys.stderr)
        include = ["-I", str(prefix / "include"), "-I", eigen]
        subprocess.run([compiler, *PEER_FLAGS, *include, "peer.cpp", "-o", "peer.so"], cwd=place, check=True)

    name = "peer-" + cache.key(source, pinocchio.__version__, *PEER_FLAGS, compiler, compiling.cpu())[:40]
    return ctypes.CDLL(str(cache.entry(name, build) / "peer.so"))


class Peer:
    """The LWR in Pinocchio, with random inertias."""

    def __init__(self) -> None:
        from modelgen.geometry.kinematics import geometry, state, transforms
        from modelgen.geometry.robot_file import load_robot

        robot = load_robot(ROBOT)
        self.lib = peer_library()
        self.lib.peer_regressor.restype = ctypes.c_double
        zero = np.zeros(JOINTS)
        frames = transforms(geometry(robot), state(robot, zero, zero, zero))
        R = np.array([np.array([f.to_antecedent(axis) for axis in np.eye(3)], float).T for f in frames])
        p = np.array([f.p for f in frames], dtype=float)
        rng = np.random.default_rng(1)
        self.standard = {}
        inertia = np.empty((JOINTS, 10))
        for j in range(JOINTS):
            mass, c = rng.uniform(1, 4), rng.uniform(-0.1, 0.1, 3)
            A = rng.normal(size=(3, 3)) * 0.1
            about_c = np.trace(A @ A.T) * np.eye(3) - A @ A.T
            about_o = about_c + mass * (c @ c * np.eye(3) - np.outer(c, c))
            inertia[j] = [
                mass,
                *(mass * c),
                *(about_o[i, k] for i, k in ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))),
            ]
            names = ("M", "MX", "MY", "MZ", "XX", "XY", "YY", "XZ", "YZ", "ZZ")
            self.standard |= {f"{name}{j + 1}": value for name, value in zip(names, inertia[j])}
        gravity = np.array([0, 0, -9.81])
        self.lib.peer_robot(JOINTS, *(_pointer(np.ascontiguousarray(x)) for x in (R, p, inertia, gravity)))

    def regressor(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        last = np.empty((JOINTS, 10 * JOINTS))
        self.lib.peer_regressor(ctypes.c_long(len(q)), *map(_pointer, (q, dq, ddq, last)))
        return last

    def rnea(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, threads: int = 1) -> np.ndarray:
        """(N, 7) torques; on two threads by Pinocchio's own rneaInParallel."""
        tau = np.empty_like(q)
        run = self.lib.peer_rnea_two_threads if threads == 2 else self.lib.peer_rnea
        run(ctypes.c_long(len(q)), *map(_pointer, (q, dq, ddq, tau)))
        return tau


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def inertial_blocks(q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> Callable[[], None]:
    """The 7 x 43 inertial base regressor alone: its non-zero entries, block by block, in a cached buffer."""
    m = generated.load(ROBOT, "B")
    kernel = m._kernel
    assert isinstance(kernel, Kernel), "no compiler"
    entries = m._description["columns"]
    nothing = np.empty(0, dtype=np.int64)
    place = Placement(np.arange(entries), nothing.astype(np.int32), nothing, nothing)
    samples = Samples(q, dq, ddq, None, np.empty((len(q), 0)))
    buffer = zero_rows(entries)

    def run() -> None:
        fill = kernel.stream(samples, buffer, place, BLOCK)
        for _ in range(0, len(q), BLOCK):
            fill()

    return run


def bounds(threads: int = 1) -> tuple[float, float]:
    """What so many threads can do now, each on arrays of its own: operations a second (BLAS on one thread
    each, n^3 additions and multiplications) and bytes a second written past the caches."""
    from threadpoolctl import threadpool_limits

    A, out = np.ones((512, 512)), np.empty((threads, 512, 512))
    big = np.empty((threads, 8_000_000))
    operations, writing = [], []

    def seconds(work: Callable[[int], object]) -> float:
        start = time.perf_counter()
        side_by_side([lambda k=k: [work(k) for _ in range(TURNS)] for k in range(threads)])
        return (time.perf_counter() - start) / (threads * TURNS)

    with threadpool_limits(1, "blas"):
        for _ in range(7):
            operations.append(2 * 512**3 / seconds(lambda k: np.matmul(A, A, out=out[k])))
            writing.append(big[0].nbytes / seconds(lambda k: big[k].fill(1.0)))
    return max(operations), max(writing)


def side_by_side(work: list[Callable[[], object]]) -> None:
    """Each on a thread of its own, the last on this one."""
    threads = [threading.Thread(target=its) for its in work[:-1]]
    for thread in threads:
        thread.start()
    work[-1]()
    for thread in threads:
        thread.join()


def consume(blocks) -> None:
    for _ in blocks:
        pass


def two_consumers(m, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> None:
    """Half of the samples for each of two threads, as a reduction over blocks would have it; TURNS times, so
    that what starting a thread takes does not count."""
    half = len(q) // 2
    parts = [slice(0, half), slice(half, len(q))]

    def work(p: slice) -> None:
        for _ in range(TURNS):
            consume(m.regressor_blocks(q[p], dq[p], ddq[p]))

    side_by_side([lambda p=p: work(p) for p in parts])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--samples", type=int, default=90_000)
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    N = options.samples
    rng = np.random.default_rng(0)
    q, dq, ddq = (
        rng.uniform(-3, 3, (N, JOINTS)),
        rng.uniform(-2, 2, (N, JOINTS)),
        rng.uniform(-5, 5, (N, JOINTS)),
    )
    peer, m = Peer(), generated.load(ROBOT, "B")
    chi = m.regroup(peer.standard)
    agreement = float(
        np.abs(m.torque(q[:999], dq[:999], ddq[:999], chi) - peer.rnea(q[:999], dq[:999], ddq[:999])).max()
    )
    agreement = max(agreement, float(np.abs(peer.rnea(q, dq, ddq, 2) - peer.rnea(q, dq, ddq)).max()))
    if agreement > 1e-9:
        sys.exit(f"the torques differ from Pinocchio's by {agreement} N m")
    out = np.zeros((N, JOINTS, len(m.parameters)))
    part = N // 3  # Pinocchio's loops are long enough on a third of the samples
    contestants: dict[str, tuple[int, Callable[[], object]]] = {
        "pinocchio regressor": (part, lambda: peer.regressor(q[:part], dq[:part], ddq[:part])),
        "pinocchio rnea": (part, lambda: peer.rnea(q[:part], dq[:part], ddq[:part])),
        "pinocchio rneaInParallel, 2 threads": (part, lambda: peer.rnea(q[:part], dq[:part], ddq[:part], 2)),
        "inertial blocks": (N, inertial_blocks(q, dq, ddq)),
        "model B blocks": (N, lambda: consume(m.regressor_blocks(q, dq, ddq))),
        "model B non-zero blocks": (N, lambda: consume(m.nonzero_blocks(q, dq, ddq))),
        "model B dense out": (N, lambda: m.regressor(q, dq, ddq, out)),
        "torque": (N, lambda: m.torque(q, dq, ddq, chi)),
        "model B dense out, 2 threads": (N, lambda: m.regressor(q, dq, ddq, out, threads=2)),
        "model B blocks, 2 consumers": (TURNS * N, lambda: two_consumers(m, q, dq, ddq)),
        "torque, 2 threads": (N, lambda: m.torque(q, dq, ddq, chi, threads=2)),
    }
    wall: dict[str, list[float]] = {name: [] for name in contestants}
    cpu: dict[str, list[float]] = {name: [] for name in contestants}
    for _ in range(options.repeats + 1):
        for name, (count, run) in contestants.items():
            start, start_cpu = time.perf_counter(), time.process_time()
            run()
            cpu[name].append((time.process_time() - start_cpu) / count * 1e9)
            wall[name].append((time.perf_counter() - start) / count * 1e9)
    medians = {
        kind: {name: statistics.median(values[1:]) for name, values in times.items()}
        for kind, times in (("wall", wall), ("cpu", cpu))
    }
    report(options, m, medians, agreement)


def report(options, m, ns: dict[str, dict[str, float]], agreement: float) -> None:
    regressor, rnea = "pinocchio regressor", "pinocchio rnea"
    parallel = "pinocchio rneaInParallel, 2 threads"
    rows = [
        ("7 x 43 inertial entries, blocks", regressor, "inertial blocks", 29),
        ("model B, regressor_blocks", regressor, "model B blocks", 15),
        ("model B, nonzero_blocks", regressor, "model B non-zero blocks", 15),
        ("model B, W whole into out", regressor, "model B dense out", 7.5),
        ("torque", rnea, "torque", 27),
        ("W whole, 2 threads / 1", "model B dense out", "model B dense out, 2 threads", 1.8),
        ("blocks, 2 consumers / 1", "model B blocks", "model B blocks, 2 consumers", 1.8),
        ("torque, 2 threads / 1", "torque", "torque, 2 threads", 1.8),
        ("torque, 2 threads / rneaInParallel", parallel, "torque, 2 threads", 15),
        ("rneaInParallel, 2 threads / rnea", rnea, parallel, 1.8),
    ]

    def ratio(kind: str, rival: str, name: str) -> float:
        cores = [2 if kind == "cpu" and "2 " in contestant else 1 for contestant in (name, rival)]
        return cores[0] / cores[1] * ns[kind][rival] / ns[kind][name]

    if options.json:
        ratios = {row[0]: {kind: ratio(kind, row[1], row[2]) for kind in ns} for row in rows}
        print(json.dumps({"median_ns": ns, "ratios": ratios}, indent=1))
        return
    print(f"{options.samples} samples, medians of {options.repeats} interleaved rounds; ns per sample")
    print("CPU: processor time of all threads, which other work on the machine disturbs less; two threads")
    print("are rated as if each had a core to itself.")
    add, mul = m.operations["add"], m.operations["mul"]
    print(f"inertial regressor, given cos and sin: {add} additions, {mul} multiplications")
    print(f"torques agree with Pinocchio's within {agreement:.1e} N m\n")
    print(f"{'':42}{'wall':>9}{'CPU':>9}")
    for name in ns["wall"]:
        print(f"{name:42}" + "".join(f"{ns[kind][name]:9.1f}" for kind in ns))
    operations, moving = bounds()
    state, torque = 3 * 8 * JOINTS, sum(m.operations["torque"].values())
    own = {  # operations; bytes of a sample that are read, and written past the caches
        "inertial blocks": (add + mul, state),
        "model B dense out": (add + mul, state + 8 * JOINTS * len(m.parameters)),
        "torque": (torque, state + 8 * JOINTS),
    }
    print(f"\none core here: {operations / 1e9:.1f} G operations/s (BLAS), {moving / 1e9:.1f} GB/s written")
    print(f"{'ns alone, and how many times that it takes':42}{'arithmetic':>18}{'memory':>18}")
    for name, (count, size) in own.items():
        bound = [count / operations * 1e9, size / moving * 1e9]
        print(f"{name:42}" + "".join(f"{b:10.1f}{ns['cpu'][name] / b:7.1f}x" for b in bound))
    both = bounds(2)
    print(f"{'two threads, nothing shared, / one':42}{both[0] / operations:17.2f}x{both[1] / moving:17.2f}x")
    print("(by wall: where these are below two, another process has a core, or both share one or its memory)")
    print(f"\n{'ratio':42}{'wall':>9}{'CPU':>9}{'target':>9}")
    for label, rival, name, target in rows:
        found = "".join(f"{ratio(kind, rival, name):8.2f}x" for kind in ns)
        print(f"{label:42}{found}{target:8}x")


if __name__ == "__main__":
    main()
