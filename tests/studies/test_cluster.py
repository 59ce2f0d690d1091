"""Study on a Dask cluster, compared with one process, with workers killed in between."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import chdir
from pathlib import Path

import pytest
from typer.testing import CliRunner

from lanes import of_clusters
from laufruhe.cli import app
from studies import clusters

pytestmark = [pytest.mark.slow, of_clusters("distributed")]
SMALL = {"draws": 2000, "chunk": 500, "scenes": 20, "few": 2, "points": 3}
KILLED_AT = 6


@pytest.fixture(scope="module")
def serial(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a study that one process computed."""
    folder = clusters.prepared(tmp_path_factory.mktemp("serial"), **SMALL)
    with chdir(folder):
        answer = CliRunner().invoke(app, ["study", "s.toml", "--out", "out", "--jobs", "1"])
    assert answer.exit_code == 0, answer.output
    return folder


@pytest.fixture(scope="module")
def workers(tmp_path_factory: pytest.TempPathFactory) -> Iterator[clusters.Cluster]:
    with clusters.cluster(tmp_path_factory.mktemp("cluster"), 2) as own:
        yield own


def test_killed_clients_workers_and_schedulers_change_no_bit(
    tmp_path: Path, serial: Path, workers: clusters.Cluster
) -> None:
    folder = clusters.prepared(tmp_path, **SMALL)
    first = clusters.started(folder, "--scheduler", workers.address)
    clusters.wait_until(lambda: clusters.pieces_done(folder) >= KILLED_AT or first.poll() is not None)
    first.kill()
    first.communicate()
    finished = clusters.pieces_done(folder)
    assert finished >= KILLED_AT
    again = clusters.started(folder, "--scheduler", workers.address)
    clusters.wait_until(lambda: clusters.pieces_done(folder) > finished or again.poll() is not None)
    # the other worker takes over its piece
    workers.kill_worker(0)
    clusters.wait_until(lambda: clusters.pieces_done(folder) > finished + 1 or again.poll() is not None)
    workers.kill()
    workers.start(1)
    said = again.communicate()[1]
    assert (again.returncode, said) == (0, "")
    assert clusters.same(serial, folder) == []
    assert clusters.pieces_done(folder) == 4 + 10


def test_an_address_without_an_answer_is_refused_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = clusters.prepared(tmp_path, **SMALL)
    monkeypatch.chdir(folder)
    answer = CliRunner().invoke(app, ["study", "s.toml", "--out", "out", "--scheduler", "nowhere"])
    assert answer.exit_code == 2
    assert answer.stderr.startswith("laufruhe: --scheduler = nowhere: does not answer (missing port")
    assert answer.stderr.count("\n") == 1
    assert not (folder / "out").exists()
