"""`ident fleet` on real workers: one table whatever computes it, broken logs as rows, errors as sentences."""

import json
import os
import signal
import subprocess
import sys
import time

import pyarrow.parquet as pq
import pytest
from recordings import recording, write_parquet

pytest.importorskip("distributed")
ENVIRONMENT = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    for r in range(2):
        (folder / f"arm{r}").mkdir()
        for k in (1, 2):
            table = recording("A", seconds=25, rate=100, seed=10 * r + k)[0]
            write_parquet(folder / f"arm{r}" / f"2026-01-0{k}.parquet", table)
    (folder / "arm1" / "2026-01-03.parquet").write_bytes(b"PAR1 and nothing more")
    return folder


def fleet(*arguments, **more):
    command = [sys.executable, "-m", "ident.command_line.cli", "fleet", *map(str, arguments)]
    done = {"capture_output": True, "text": True, "timeout": 100, "env": ENVIRONMENT} | more
    return subprocess.run([*command, "--robot", "kuka_lwr4p", "--no-diagnose"], **done)


@pytest.fixture(scope="module")
def plain(logs, tmp_path_factory):
    """The table as this one process makes it."""
    out = tmp_path_factory.mktemp("plain") / "out"
    done = fleet(f"{logs}/{{robot}}/{{day}}.parquet", "-o", out)
    assert done.returncode == 0, done.stderr
    assert "arm1, 2026-01-03" in done.stderr and "4 of 5 recordings of 2 robots" in done.stdout
    return out


def test_the_table_has_a_row_a_window_and_one_for_a_broken_log(plain):
    rows = pq.read_table(plain / "fleet.parquet").to_pylist()
    assert [(row["robot"], row["day"]) for row in rows] == [
        *[("arm0", f"2026-01-0{k}") for k in (1, 2)],
        *[("arm1", f"2026-01-0{k}") for k in (1, 2, 3)],
    ]
    assert "truncated or damaged" in rows[-1]["reason"] and rows[-1]["value.Iam5"] is None
    assert 0 < rows[0]["error_percent"] < 20 and rows[0]["std.Iam5"] > 0 and rows[0]["speed.1"] > 0
    assert "could not be used" in (plain / "report.html").read_text()


def test_a_second_run_reads_what_is_there(plain, logs):
    before = (plain / "fleet.parquet").read_bytes()
    kept = next((plain / "summaries").rglob("*.ident.parquet"))
    stamp = kept.stat().st_mtime_ns
    assert fleet(f"{logs}/{{robot}}/{{day}}.parquet", "-o", plain).returncode == 0
    assert kept.stat().st_mtime_ns == stamp
    assert (plain / "fleet.parquet").read_bytes() == before


def dask(*arguments):
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    if arguments[0] == "worker":
        command = [sys.executable, "-m", "distributed.cli.dask_worker"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen([*command, *arguments[1:], "--no-dashboard"], env=ENVIRONMENT, **quiet)


def test_a_killed_worker_changes_no_bit(plain, logs, tmp_path):
    address = tmp_path / "scheduler.json"
    running = [dask("scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(address))]
    try:
        while not address.exists():
            time.sleep(0.1)
        options = ("--nthreads", "1", "--host", "127.0.0.1", "--no-nanny", "--scheduler-file", str(address))
        running += [dask("worker", *options, "--local-directory", str(tmp_path)) for _ in range(2)]
        out = tmp_path / "out"
        command = [
            sys.executable,
            "-m",
            "ident.command_line.cli",
            "fleet",
            f"{logs}/{{robot}}/{{day}}.parquet",
        ]
        command += ["--robot", "kuka_lwr4p", "--no-diagnose", "-o", str(out)]
        command += ["--scheduler", json.loads(address.read_text())["address"]]
        work = subprocess.Popen(command, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        running.append(work)
        while not list(out.glob("summaries/*/*")) and work.poll() is None:
            time.sleep(0.05)
        running[1].send_signal(signal.SIGKILL)  # one of the two workers, in the middle
        _, error = work.communicate(timeout=60)
        assert work.returncode == 0, error.decode()
        assert (out / "fleet.parquet").read_bytes() == (plain / "fleet.parquet").read_bytes()
    finally:
        for process in reversed(running):
            process.kill()
            process.wait()


def test_s3_gives_the_same_table_and_a_missing_bucket_a_sentence(plain, logs, tmp_path, monkeypatch):
    moto = pytest.importorskip("moto.server")
    pytest.importorskip("s3fs")
    server = moto.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    try:
        host, port = server.get_host_and_port()
        keys = {"AWS_ACCESS_KEY_ID": "a", "AWS_SECRET_ACCESS_KEY": "b", "AWS_DEFAULT_REGION": "us-east-1"}
        keys["AWS_ENDPOINT_URL"] = keys["FSSPEC_S3_ENDPOINT_URL"] = f"http://{host}:{port}"
        for name, value in keys.items():
            monkeypatch.setenv(name, value)
        import s3fs

        fs = s3fs.S3FileSystem(endpoint_url=keys["AWS_ENDPOINT_URL"], key="a", secret="b")
        fs.mkdir("logs")
        fs.put(str(logs) + "/", "logs/", recursive=True)
        out = tmp_path / "out"
        done = fleet("s3://logs/{robot}/{day}.parquet", "-o", out, env=ENVIRONMENT | keys)
        assert done.returncode == 0, done.stderr
        mine, its = (pq.read_table(place / "fleet.parquet") for place in (out, plain))
        apart = ["recording", "reason"]  # addresses
        assert mine.drop_columns(apart).equals(its.drop_columns(apart))
        none = fleet("s3://nobody/{robot}/{day}.parquet", "-o", tmp_path / "n", env=ENVIRONMENT | keys)
        assert none.returncode == 2 and len(none.stderr.strip().splitlines()) == 1, none.stderr
    finally:
        server.stop()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["LOGS/*/*.parquet", "--robot", "nobody"], "nobody is neither a readable robot file"),
        (["LOGS/none/*.parquet"], "names no recording"),
        (["LOGS/{machine}/*.parquet"], "a pattern knows {robot} and {day}"),
        (["TWINS/*/*/*.parquet"], "two robots are called arm0"),
        (["TWINS/*/{robot}/{day}.parquet"], "are both 2026-01-01 of arm0"),
        (["TABLE.csv"], "has no columns file and robot"),
        (["LOGS/*/*.parquet", "--study", "TABLE.yaml"], "leave estimator, robust and controller out"),
        (["LOGS/*/*.parquet", "--scheduler", "nowhere"], "no Dask scheduler answers at nowhere"),
    ],
)
def test_wrong_inputs_end_in_one_sentence(logs, tmp_path, arguments, said, capsys):
    from ident.command_line.cli import run

    for place in ("a", "b"):
        (tmp_path / place / "arm0").mkdir(parents=True)
        (tmp_path / place / "arm0" / "2026-01-01.parquet").write_bytes(b"x")
    (tmp_path / "TABLE.csv").write_text("path,arm\n")
    study = {"robot": "kuka_lwr4p", "estimator": "irls", "recordings": [{"file": "x.parquet"}]}
    (tmp_path / "TABLE.yaml").write_text(json.dumps(study))
    words = [
        word.replace("LOGS", str(logs)).replace("TWINS", str(tmp_path)).replace("TABLE", f"{tmp_path}/TABLE")
        for word in arguments
    ]
    robot = [] if "--robot" in words else ["--robot", "kuka_lwr4p"]
    assert run(["fleet", *words, *robot, "-o", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err.strip()
    assert said in error and len(error.splitlines()) == 1


def test_without_permission_or_scheduler_what_was_done_stays(plain, logs, monkeypatch, capsys):
    from fsspec.implementations.memory import MemoryFileSystem

    from ident.command_line.cli import run

    def refused(*_, **__):
        raise PermissionError("Access Denied")

    monkeypatch.setattr(MemoryFileSystem, "glob", refused)
    before = {path: path.read_bytes() for path in sorted(plain.rglob("*.parquet"))}
    for arguments, said in (
        (["memory://bucket/{robot}/{day}.parquet"], "check the address and the permission to read it"),
        ([f"{logs}/*/*.parquet", "--scheduler", "nowhere"], "no Dask scheduler answers at nowhere"),
    ):
        status = run(["fleet", *arguments, "-o", str(plain), "--robot", "kuka_lwr4p"])
        told = capsys.readouterr().err
        assert status == 2 and told.count("\n") == 1 and said in told, told
    assert before == {path: path.read_bytes() for path in sorted(plain.rglob("*.parquet"))}


def test_a_recording_that_may_not_be_read_is_a_row(monkeypatch, tmp_path):
    import fsspec
    from fsspec.implementations.memory import MemoryFileSystem

    from ident.fleet.jobs import Job
    from ident.fleet.work import summarised

    def refused(*_, **__):
        raise PermissionError("Forbidden")

    with fsspec.open("memory://fleet/arm0/1.parquet", "wb") as out:
        out.write(b"x")
    monkeypatch.setattr(MemoryFileSystem, "get_file", refused)
    done = summarised(Job("arm0", "1", "memory://fleet/arm0/1.parquet", "k"), {}, str(tmp_path))
    assert "permission" in done.reason and not done.data
