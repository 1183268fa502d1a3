"""TLS between this machine and a Dask cluster: certificates as given, or as `distributed` itself is configured."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from replay.errors import InvalidValue

_SCHEME = "tls://"
_HOW = "--dask-ca and --dask-cert, or distributed's own configuration (distributed.comm.tls)"


@dataclass(frozen=True)
class Certificates:
    """Who is trusted, and who we are; PEM files.

    Attributes:
        authority: certificate of the authority that signed the scheduler's and the workers' certificates.
        certificate: our own, signed by it.
        key: the private key of our own; None when it is in the certificate's file.
    """

    authority: Path
    certificate: Path
    key: Path | None = None

    @staticmethod
    def of(authority: Path | None, certificate: Path | None, key: Path | None) -> Certificates | None:
        """Return certificates as options name them; None when there are none.

        Raises:
            InvalidValue: one is named and another one that it needs is not.
        """
        if authority is None and certificate is None and key is None:
            return None
        if authority is None or certificate is None:
            missing = "--dask-ca" if authority is None else "--dask-cert"
            raise InvalidValue(missing, "", "is missing; TLS needs --dask-ca and --dask-cert (and --dask-key)")
        return Certificates(authority, certificate, key)


def security_for(address: str, certificates: Certificates | None) -> Any:
    """Return distributed's Security for a connection to a scheduler.

    Without certificates of ours it is what `distributed` is configured to, which may be none for tcp:// addresses.

    Args:
        address: of the scheduler.
        certificates: replace those of the configuration.

    Raises:
        InvalidValue: the address and the certificates do not belong together, or a file cannot be used.
    """
    from distributed import Security

    encrypted = address.startswith(_SCHEME)
    if certificates is not None and not encrypted:
        raise InvalidValue("dask", address, f"must begin with {_SCHEME} where certificates are given")
    try:
        if certificates is None:
            security: Any = Security()  # type: ignore[no-untyped-call]
        else:
            own = {"tls_ca_file": certificates.authority, "tls_client_cert": certificates.certificate}
            own["tls_client_key"] = certificates.key or certificates.certificate
            security = Security(require_encryption=True, **{k: str(v) for k, v in own.items()})  # type: ignore[no-untyped-call]
        context = security.get_connection_args("client")["ssl_context"]
    except (OSError, ValueError) as error:  # an ssl.SSLError is an OSError
        raise InvalidValue(*_unusable(certificates, error)) from None
    if encrypted and context is None:
        raise InvalidValue("dask", address, f"needs certificates: {_HOW}")
    return security


def _unusable(certificates: Certificates | None, error: Exception) -> tuple[str, object, str]:
    """Return which certificate is at fault, its file, and why: the library's error often names neither."""
    import ssl

    if certificates is None:
        return "distributed.comm.tls", "as configured", f"cannot be used: {error}"
    files = {
        "--dask-ca": certificates.authority,
        "--dask-cert": certificates.certificate,
        "--dask-key": certificates.key,
    }
    for name, file in files.items():
        if file is not None:
            try:
                file.read_bytes()
            except OSError as unread:
                return name, file, f"cannot be read: {unread.strerror}"
    try:
        ssl.create_default_context(cafile=str(certificates.authority))
    except OSError:
        return "--dask-ca", certificates.authority, "holds no certificate in PEM form"
    reason = "holds no certificate in PEM form with its private key, or --dask-key is of another one"
    return "--dask-cert", certificates.certificate, reason
