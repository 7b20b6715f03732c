"""What the commands of `ident` do: read, call the pure part with a progress bar, write, say what came out."""

from pathlib import Path

from ident.terminal import print_table, progress_bar


def simulate(
    robot: str,
    output: Path,
    model: str,
    effects: tuple[str, ...],
    payload: float | None,
    seed: int,
    parameters: Path | None,
    verbose: bool,
) -> None:
    """`ident simulate`: recordings and a study; the hidden truth is written beside them."""
    from ident.output import writable
    from ident.simulate import simulate_command

    writable(output)
    with progress_bar(verbose) as progress:
        made = simulate_command(robot, output, model, effects, payload, seed, parameters, progress)
    rows = []
    for recording in made.recordings:
        t = recording.columns["t"]
        rows.append(
            (
                f"{recording.label}.parquet",
                recording.use,
                recording.payload or "",
                f"{t[-1] - t[0]:.0f}",
                str(len(t)),
            )
        )
    print_table(made.robot.name, ("recording", "use", "payload", "seconds", "samples"), rows, numbers=(3, 4))
    print(f"wrote {output / 'study.yaml'}; next: ident diagnose {output / 'study.yaml'} -o RESULTS")
