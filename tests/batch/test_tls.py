"""TLS with a Dask cluster: with certificates it runs, without or with wrong ones it is one clear line."""

import shutil

import pytest

from replay.batch.run import Execution, run_all
from replay.batch.tls import Certificates, security_for
from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from replay.errors import InvalidValue, WorkerError
from tests.batch import clusters, scenes

pytestmark = pytest.mark.skipif(shutil.which("openssl") is None, reason="needs openssl to make certificates")


@pytest.fixture(scope="module")
def ours(tmp_path_factory):
    return clusters.authority(tmp_path_factory.mktemp("ours"), "ours")


@pytest.fixture(scope="module")
def theirs(tmp_path_factory):
    return clusters.authority(tmp_path_factory.mktemp("theirs"), "theirs")


@pytest.fixture(scope="module")
def encrypted(ours, tmp_path_factory):
    """Yield the address of a cluster that knows only those whom our authority has signed."""
    files = ("--tls-ca-file", str(ours["ca"]), "--tls-cert", str(ours["cert"]), "--tls-key", str(ours["key"]))
    with clusters.cluster(tmp_path_factory.mktemp("cluster"), *files, "--protocol", "tls", workers=1) as found:
        assert found.address.startswith("tls://")
        yield found.address


def given(files):
    return ["--dask-ca", str(files["ca"]), "--dask-cert", str(files["cert"]), "--dask-key", str(files["key"])]


def test_a_cluster_with_tls_runs_scenarios(encrypted, ours, tmp_path):
    path = scenes.write(tmp_path / "in", "a")
    command = ["run", str(path), "-o", str(tmp_path / "out"), "--no-rrd", "--dask", encrypted]
    assert run([*command, *given(ours)]) is ExitCode.FINE
    assert (tmp_path / "out" / "a" / "a.mcap").is_file()


def test_the_librarys_own_configuration_will_do(encrypted, ours, tmp_path):
    import dask

    own = {"distributed.comm.tls.ca-file": str(ours["ca"]), "distributed.comm.tls.client.cert": str(ours["cert"])}
    with dask.config.set({**own, "distributed.comm.tls.client.key": str(ours["key"])}):
        found = run_all([scenes.scene("a")], tmp_path, rrd=False, execution=Execution(dask=encrypted))
    assert found.passed


def test_a_cluster_of_another_authority_is_not_trusted(encrypted, theirs, tmp_path, monkeypatch):
    monkeypatch.setattr("replay.batch.cluster._SECONDS_TO_CONNECT", 3)
    execution = Execution(dask=encrypted, certificates=Certificates(theirs["ca"], theirs["cert"], theirs["key"]))
    with pytest.raises(WorkerError, match="CERTIFICATE_VERIFY_FAILED"):
        run_all([scenes.scene("a")], tmp_path, rrd=False, execution=execution)


def test_a_cluster_does_not_take_whom_it_does_not_know(encrypted, ours, theirs, tmp_path, monkeypatch):
    monkeypatch.setattr("replay.batch.cluster._SECONDS_TO_CONNECT", 3)
    execution = Execution(dask=encrypted, certificates=Certificates(ours["ca"], theirs["cert"], theirs["key"]))
    with pytest.raises(WorkerError, match="does not answer"):
        run_all([scenes.scene("a")], tmp_path, rrd=False, execution=execution)


def test_an_encrypted_address_needs_certificates(tmp_path, capsys):
    path = scenes.write(tmp_path / "in", "a")
    command = ["run", str(path), "-o", str(tmp_path / "out"), "--dask", "tls://127.0.0.1:9"]
    assert run(command) is ExitCode.INVALID
    assert "dask = tls://127.0.0.1:9: needs certificates: --dask-ca and --dask-cert" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"ca": None}, "--dask-ca = : is missing"),
        ({"cert": None}, "--dask-cert = : is missing"),
        ({"ca": "none.pem"}, "--dask-ca = .*none.pem: cannot be read: No such file"),
        ({"key": "none.pem"}, "--dask-key = .*none.pem: cannot be read: No such file"),
        ({"ca": "text"}, "--dask-ca = .*text: holds no certificate in PEM form"),
        ({"cert": "text"}, "--dask-cert = .*text: holds no certificate in PEM form with its private key"),
        ({"key": "other"}, "--dask-cert = .*: holds no certificate .*, or --dask-key is of another one"),
        ({"key": None}, "--dask-cert = .*: holds no certificate in PEM form with its private key"),
    ],
)
def test_certificates_that_cannot_be_used_are_named(ours, theirs, tmp_path, change, message):
    (tmp_path / "text").write_text("no certificate\n")
    places = {"none.pem": tmp_path / "none.pem", "text": tmp_path / "text", "other": theirs["key"], None: None}
    files = {**ours, **{name: places[what] for name, what in change.items()}}
    with pytest.raises(InvalidValue, match=message):
        security_for("tls://127.0.0.1:8786", Certificates.of(files["ca"], files["cert"], files["key"]))


def test_a_key_may_be_in_the_certificates_file(ours, tmp_path):
    both = tmp_path / "both.pem"
    both.write_bytes(ours["cert"].read_bytes() + ours["key"].read_bytes())
    security = security_for("tls://127.0.0.1:8786", Certificates.of(ours["ca"], both, None))
    assert security.require_encryption


def test_certificates_and_addresses_belong_together(ours, tmp_path, capsys):
    with pytest.raises(InvalidValue, match=r"tcp://127\.0\.0\.1:8786: must begin with tls://"):
        security_for("tcp://127.0.0.1:8786", Certificates(ours["ca"], ours["cert"], ours["key"]))
    path = scenes.write(tmp_path / "in", "a")
    assert run(["run", str(path), "-o", str(tmp_path / "out"), *given(ours)]) is ExitCode.INVALID
    assert "belong to --dask" in capsys.readouterr().err
