"""The cache: whole entries or none, made again when damaged, never loaded from where others can write."""

import multiprocessing
import os
import stat
import subprocess
import sys
import threading
import warnings
from pathlib import Path

import numpy as np
import pytest
from two_links import TWO_LINKS

from generated import cache, compiling, loading

posix = pytest.mark.skipif(os.name == "nt", reason="permissions of a POSIX system")


@pytest.fixture
def robot(tmp_path, monkeypatch):
    """A robot file, an empty cache, and nothing remembered."""
    monkeypatch.setenv("DYNIDENT_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(loading, "_loaded", {})
    monkeypatch.setattr(compiling, "FLAGS", tuple(f.replace("-O3", "-O0") for f in compiling.FLAGS))
    path = tmp_path / "two_links.yaml"
    path.write_text(TWO_LINKS)
    return path


def evaluate(robot):
    x = np.linspace(0.1, 1.2, 20).reshape(10, 2)
    return loading.load(robot, "B").regressor(x, x + 1, x + 2)


def entries(root):
    return sorted(p.name for p in Path(root).iterdir())


def test_a_robot_file_is_derived_once_and_found_again(robot, tmp_path, monkeypatch):
    first = evaluate(robot)
    made = entries(tmp_path / "cache")
    assert [name.split("-")[0] for name in made] == ["kernel", "model"]
    monkeypatch.setattr(loading, "_loaded", {})
    monkeypatch.setattr(compiling, "_compile", None)
    monkeypatch.setattr(loading, "_derive", None)
    np.testing.assert_array_equal(evaluate(robot), first)
    assert entries(tmp_path / "cache") == made


def test_a_changed_robot_file_is_another_robot(robot, tmp_path):
    first = evaluate(robot)
    robot.write_text(TWO_LINKS.replace("0.3", "0.7"))
    assert not np.array_equal(evaluate(robot), first)


@pytest.mark.first_case
@pytest.mark.parametrize("kind", ["kernel", "model"])
@pytest.mark.parametrize("damage", ["truncate", "flip", "delete", "no manifest", "empty"])
def test_a_damaged_entry_is_made_again(robot, tmp_path, monkeypatch, kind, damage):
    first = evaluate(robot)
    [place] = (tmp_path / "cache").glob(f"{kind}-*")
    victim = place / {"kernel": "kernel.so", "model": "model.json"}[kind]
    data = victim.read_bytes()
    victim.unlink()  # a new file: this process still maps the old library
    if damage == "truncate":
        victim.write_bytes(data[: len(data) // 2])
    elif damage == "flip":
        victim.write_bytes(data[:-9] + bytes([data[-9] ^ 1]) + data[-8:])
    elif damage == "no manifest":
        victim.write_bytes(data)
        (place / cache.MANIFEST).unlink()
    elif damage == "empty":
        for path in place.iterdir():
            path.unlink()
    monkeypatch.setattr(loading, "_loaded", {})
    np.testing.assert_array_equal(evaluate(robot), first)
    assert cache._whole(place)
    assert not [name for name in entries(tmp_path / "cache") if name.startswith(".")]


def test_a_build_that_fails_leaves_nothing(robot, tmp_path):
    def build(place):
        (place / "half").write_text("half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cache.entry("entry", build)
    assert entries(tmp_path / "cache") == []


@posix
def test_a_folder_that_others_can_write_is_not_used(robot, tmp_path):
    root = tmp_path / "cache"
    evaluate(robot)
    root.chmod(0o777)
    cache._checked.cache_clear()
    with pytest.warns(
        UserWarning, match="can be written by others; models are compiled for this process only"
    ):
        place = cache.folder()
    assert place != root and stat.S_IMODE(place.stat().st_mode) == 0o700
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert cache.folder() == place  # said once
    root.chmod(0o700)
    cache._checked.cache_clear()


@posix
def test_a_folder_below_one_that_anyone_can_write_is_not_used(robot, tmp_path, monkeypatch):
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    monkeypatch.setenv("DYNIDENT_CACHE", str(tmp_path / "open" / "cache"))
    with pytest.warns(UserWarning, match="which anyone can write"):
        cache.folder()


@posix
def test_an_entry_that_others_can_write_is_made_again(robot, tmp_path, monkeypatch):
    first = evaluate(robot)
    [place] = (tmp_path / "cache").glob("kernel-*")
    place.chmod(0o777)
    monkeypatch.setattr(loading, "_loaded", {})
    np.testing.assert_array_equal(evaluate(robot), first)
    assert stat.S_IMODE(place.stat().st_mode) & 0o022 == 0


@posix
def test_a_new_cache_is_closed_to_others(robot, tmp_path):
    evaluate(robot)
    assert stat.S_IMODE((tmp_path / "cache").stat().st_mode) == 0o700


@posix
def test_a_cache_that_cannot_be_written_is_replaced(robot, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("DYNIDENT_CACHE", str(tmp_path / "file" / "cache"))
    with pytest.warns(UserWarning, match="cannot be written"):
        evaluate(robot)


def _evaluate_in_process(robot, queue):
    try:
        queue.put(evaluate(robot))
    except BaseException as error:
        queue.put(repr(error))


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_two_processes_at_once(robot, tmp_path, method):
    if method not in multiprocessing.get_all_start_methods():
        pytest.skip(f"no {method} here")
    code = "import sys; from generated import load; import numpy as np; x = np.ones((3, 2)); "
    code += "print(load(sys.argv[1], 'B').regressor(x, x, x).sum())"
    if method == "spawn":
        running = [
            subprocess.Popen([sys.executable, "-c", code, str(robot)], stdout=subprocess.PIPE)
            for _ in range(2)
        ]
        sums = {p.communicate(timeout=120)[0] for p in running}
        assert len(sums) == 1 and all(p.returncode == 0 for p in running)
    else:
        context = multiprocessing.get_context("fork")
        queue = context.Queue()
        running = [context.Process(target=_evaluate_in_process, args=(robot, queue)) for _ in range(2)]
        for p in running:
            p.start()
        results = [queue.get(timeout=120) for _ in running]
        for p in running:
            p.join(60)
        np.testing.assert_array_equal(results[0], results[1])
    assert len(entries(tmp_path / "cache")) == 2


def test_threads_at_once(robot):
    results = []
    threads = [threading.Thread(target=lambda: results.append(evaluate(robot))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(results) == 4
    for result in results[1:]:
        np.testing.assert_array_equal(result, results[0])


def test_a_loaded_model_works_in_a_forked_child_and_can_be_sent_to_a_process(robot):
    import pickle

    model = loading.load(robot, "B")
    assert pickle.loads(pickle.dumps(model)) is model
    if "fork" not in multiprocessing.get_all_start_methods():
        pytest.skip("no fork here")
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=_evaluate_in_process, args=(robot, queue))
    child.start()
    np.testing.assert_array_equal(queue.get(timeout=60), evaluate(robot))
    child.join(60)


def test_without_a_compiler_numpy_stands_in_with_one_warning(robot, monkeypatch):
    first = evaluate(robot)
    x = np.linspace(0.1, 1.2, 20).reshape(10, 2)
    tau = loading.load(robot, "B").torque(x, x, x, np.arange(1.0, 1 + first.shape[2]))
    monkeypatch.setattr(loading, "_loaded", {})
    monkeypatch.setattr(compiling, "compilers", lambda: ())
    with pytest.warns(UserWarning, match=r"No C compiler works here .* install gcc or clang") as caught:
        slow = loading.load(robot, "B")
        again = slow.regressor(x, x + 1, x + 2)
        slow.regressor(x, x + 1, x + 2)
    assert len(caught) == 1
    np.testing.assert_allclose(again, first, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(slow.torque(x, x, x, np.arange(1.0, 1 + first.shape[2])), tau, rtol=1e-13)
    for rows, W in slow.regressor_blocks(x, x + 1, x + 2):
        np.testing.assert_allclose(W, first[rows], rtol=1e-13, atol=1e-13)


def test_a_compiler_that_fails_is_told_in_the_warning(robot, monkeypatch):
    monkeypatch.setattr(compiling, "compilers", lambda: (("false",),))
    with pytest.warns(UserWarning, match="false failed"):
        evaluate(robot)


def test_import_is_light_and_the_lwr_needs_no_sympy():
    code = (
        "import sys, generated; heavy = {'sympy', 'casadi', 'modelgen', 'scipy'} & set(sys.modules); "
        "assert not heavy, heavy; import numpy as np; m = generated.load('kuka_lwr4p', 'A', payload='L'); "
        "x = np.ones((4, 7)); m.regressor(x, x, x); m.torque(x, x, x, np.ones(79)); "
        "assert not {'sympy', 'casadi'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


@posix
@pytest.mark.parametrize(
    ("broken", "says"),
    [
        ("cc -ffast-math", "gives wrong numbers: .* differs from NumPy"),
        ("cc -include stop.h", "stopped the process"),
    ],
)
def test_a_kernel_that_the_compiler_broke_is_not_used(robot, tmp_path, monkeypatch, broken, says):
    """Each is one compiler with flags, as CC may hold; the numbers come from NumPy then, with a warning."""
    right = evaluate(robot)
    monkeypatch.setattr(loading, "_loaded", {})
    monkeypatch.setenv("DYNIDENT_CACHE", str(tmp_path / "other"))
    (tmp_path / "stop.h").write_text(
        "#include <stdlib.h>\nstatic void __attribute__((constructor)) stop(void) { abort(); }\n"
    )
    monkeypatch.setattr(compiling, "FLAGS", tuple(f.replace("-O0", "-O2") for f in compiling.FLAGS))
    command = tuple(broken.replace("stop.h", str(tmp_path / "stop.h")).split())
    monkeypatch.setattr(compiling, "compilers", lambda: (command,))
    with pytest.warns(UserWarning, match=f"No C compiler works here .*{says}"):
        np.testing.assert_allclose(evaluate(robot), right, rtol=1e-12, atol=1e-12)
    assert [name.split("-")[0] for name in entries(tmp_path / "other")] == ["model"]
