"""The fleet's broker on this computer: its folder, certificates and configuration of mosquitto.

Robots connect to one port and fleet managers to the next, each with an authority of its own for client certificates. A
robot's certificate names its serial number, which becomes user name and client id: with another robot's client id, a
robot could end its session and receive its orders.
"""

from __future__ import annotations

import datetime
import ipaddress
import json
import os
import pwd
import re
import secrets
import shutil
import socket
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import psutil
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from robot_stack.cli.errors import WRONG_USE, CommandError, writing
from robot_stack.core.atomic_file import replace_file

MASTER: Final = "master"
LONGEST_PACKET_BYTES: Final = 524_288
_SERIAL: Final = re.compile(r"[A-Za-z0-9_.:-]{1,64}")  # VDA 5050, MQTT topic levels; a common name has at most 64
_CA_LIFE: Final = datetime.timedelta(days=3650)
_LIFE: Final = datetime.timedelta(days=397)
_SLOW_CLOCK: Final = datetime.timedelta(days=1)  # of another computer
_PLACES: Final = ("/usr/sbin/mosquitto", "/usr/local/sbin/mosquitto")

# What a robot writes and reads of its own; %u is the common name of its certificate.
_OWN_WRITE: Final = ("state", "visualization", "connection", "factsheet")
_OWN_READ: Final = ("order", "instantActions", "zoneSet", "responses")


@dataclass(frozen=True, slots=True)
class Files:
    """Paths of what a client needs."""

    ca: Path
    certificate: Path
    key: Path


class Site:
    """folder: private to its user. Created with its authorities by :meth:`prepare`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @property
    def _settings_file(self) -> Path:
        return self.folder / "site.json"

    def settings(self) -> dict[str, str | int | bool]:
        """Of the last start: host, port, local. Raises CommandError if the broker was never started."""
        try:
            found: dict[str, str | int | bool] = json.loads(self._settings_file.read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise CommandError(f"{self.folder} has no broker: start one with `robot-stack fleet up`") from None
        return found

    def robot_url(self) -> str:
        settings = self.settings()
        return f"{'mqtt' if settings['local'] else 'mqtts'}://{settings['host']}:{settings['port']}"

    def master_url(self) -> str:
        settings = self.settings()
        if settings["local"]:
            return f"mqtt://127.0.0.1:{settings['port']}"
        return f"mqtts://localhost:{int(settings['port']) + 1}"

    def master(self) -> Files:
        return self._files(MASTER, "masters")

    def robot(self, serial: str) -> Files:
        return self._files(serial, "robots")

    def server(self) -> tuple[Path, Path]:
        """The broker's certificate and key, which also serve the fleet page. Raises CommandError without them."""
        files = self.folder / "server" / "server.crt", self.folder / "server" / "server.key"
        if self.settings()["local"] or not all(path.is_file() for path in files):
            raise CommandError(f"{self.folder} has no certificates: start the broker without --local")
        return files

    def names(self) -> list[str]:
        """Host names and addresses of this computer, the one for robots first."""
        return list(dict.fromkeys([str(self.settings()["host"]), *_own_names()]))

    def page_token(self) -> str:
        """Lets a browser open the fleet page; created once."""
        file = self.folder / "page_token"
        if not file.is_file():
            self.folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            _write(file, secrets.token_urlsafe(32))
        return file.read_text(encoding="utf-8")

    def robots(self) -> list[str]:
        return sorted(path.name for path in (self.folder / "robots").glob("*") if (path / "client.crt").is_file())

    def prepare(self, port: int, *, local: bool, names: Sequence[str]) -> Path:
        """Writes what is missing, and mosquitto's configuration, whose path it returns.

        names: host names and addresses of the broker besides this computer's own; the first is the one for robots.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        self.folder.chmod(0o700)
        (self.folder / "broker").mkdir(exist_ok=True, mode=0o700)
        host = "127.0.0.1" if local else (names[0] if names else socket.gethostname())
        _write(self._settings_file, json.dumps({"host": host, "port": port, "local": local}) + "\n")
        if not local:
            for authority in ("server", "robots", "masters"):
                self._authority(authority)
            self._write_revoked()
            self._issue("server", self.folder / "server", host, server=[*names, *_own_names()])
            if not self.master().certificate.is_file():
                self._issue("masters", self.master().certificate.parent, MASTER)
            _write(self.folder / "acl", acl_text())
        file = self.folder / "mosquitto.conf"
        _write(file, self._configuration(port, local=local))
        return file

    def add_robot(self, serial: str, *, again: bool = False) -> Files:
        """Issues certificate and key of a robot. Raises CommandError for a wrong or used serial number.

        again: replaces those that exist.
        """
        if not _SERIAL.fullmatch(serial) or serial in (".", ".."):
            raise CommandError(
                f"{serial!r} is no serial number of VDA 5050: up to 64 of A-Z a-z 0-9 _ . : -", WRONG_USE
            )
        if serial == MASTER:  # the rules of the broker know the manager by this name
            raise CommandError(f"{serial!r} is reserved for fleet managers", WRONG_USE)
        self.settings()
        if not (self._ca("robots") / "ca.key").is_file():
            raise CommandError("the broker was started with --local: it has no certificates")
        exists = serial in self.robots()
        if exists and not again:
            raise CommandError(f"{serial} has a certificate: `robot-stack fleet rotate {serial}` replaces it")
        if again and not exists:
            raise CommandError(f"{serial} has no certificate; there are: {', '.join(self.robots()) or 'none'}")
        self._issue("robots", self.robot(serial).certificate.parent, serial)
        return self.robot(serial)

    def revoke(self, serial: str) -> None:
        """Rejects the present certificate of a robot from the next start of the broker on."""
        if serial not in self.robots():
            raise CommandError(f"{serial} has no certificate; there are: {', '.join(self.robots()) or 'none'}")
        old = x509.load_pem_x509_certificate(self.robot(serial).certificate.read_bytes())
        _write(self._revoked_file, json.dumps([*self._revoked(), old.serial_number]) + "\n")
        self._write_revoked()

    # --- certificates ------------------------------------------------------------------------------------------------

    def _files(self, name: str, authority: str) -> Files:
        folder = self.folder / authority / name
        return Files(folder / "ca.crt", folder / "client.crt", folder / "client.key")

    def _ca(self, authority: str) -> Path:
        return self.folder / "authorities" / authority

    def _authority(self, name: str) -> None:
        folder = self._ca(name)
        if (folder / "ca.crt").is_file():
            return
        key = ec.generate_private_key(ec.SECP256R1())
        subject = _name(f"robot_stack fleet {name}")
        built = (
            _builder(subject, subject, key.public_key(), _CA_LIFE)
            .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
            .add_extension(_usage(authority=True), critical=True)
            .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        )
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        _write(folder / "ca.key", _key_text(key))
        _write(folder / "ca.crt", _certificate_text(built.sign(key, hashes.SHA256())))

    @property
    def _revoked_file(self) -> Path:
        return self._ca("robots") / "revoked.json"

    def _revoked(self) -> list[int]:
        if not self._revoked_file.is_file():
            return []
        numbers: list[int] = json.loads(self._revoked_file.read_text(encoding="utf-8"))
        return numbers

    def _write_revoked(self) -> None:
        """The list of revoked certificates as mosquitto reads it."""
        signer, signing_key = self._signer("robots")
        now = datetime.datetime.now(datetime.UTC)
        built = x509.CertificateRevocationListBuilder().issuer_name(signer.subject)
        built = built.last_update(now - _SLOW_CLOCK).next_update(now + _CA_LIFE)
        for number in self._revoked():
            entry = x509.RevokedCertificateBuilder().serial_number(number).revocation_date(now - _SLOW_CLOCK)
            built = built.add_revoked_certificate(entry.build())
        text = built.sign(signing_key, hashes.SHA256()).public_bytes(serialization.Encoding.PEM).decode()
        _write(self._ca("robots") / "revoked.pem", text)

    def _signer(self, authority: str) -> tuple[x509.Certificate, ec.EllipticCurvePrivateKey]:
        certificate = x509.load_pem_x509_certificate((self._ca(authority) / "ca.crt").read_bytes())
        key = serialization.load_pem_private_key((self._ca(authority) / "ca.key").read_bytes(), None)
        assert isinstance(key, ec.EllipticCurvePrivateKey)
        return certificate, key

    def _issue(self, authority: str, folder: Path, common_name: str, server: Sequence[str] = ()) -> None:
        """Writes key, certificate and the authority that a client of the broker trusts. server: names of the broker."""
        signer, signing_key = self._signer(authority)
        key = ec.generate_private_key(ec.SECP256R1())
        purpose = ExtendedKeyUsageOID.SERVER_AUTH if server else ExtendedKeyUsageOID.CLIENT_AUTH
        built = (
            _builder(_name(common_name), signer.subject, key.public_key(), _LIFE)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(_usage(authority=False), critical=True)
            .add_extension(x509.ExtendedKeyUsage([purpose]), critical=False)
            .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(signing_key.public_key()), critical=False)
        )
        if server:
            alternatives = [_alternative(name) for name in dict.fromkeys(server)]
            built = built.add_extension(x509.SubjectAlternativeName(alternatives), critical=False)
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        stem = "server" if server else "client"
        _write(folder / f"{stem}.key", _key_text(key))
        _write(folder / f"{stem}.crt", _certificate_text(built.sign(signing_key, hashes.SHA256())))
        _write(folder / "ca.crt", (self._ca("server") / "ca.crt").read_text(encoding="utf-8"))

    # --- mosquitto ---------------------------------------------------------------------------------------------------

    def _configuration(self, port: int, *, local: bool) -> str:
        lines = [
            # Started by root, mosquitto would change to a user that cannot read this folder.
            f"user {pwd.getpwuid(os.getuid()).pw_name}",
            "persistence true",
            f"persistence_location {self.folder / 'broker'}/",
            "autosave_interval 60",
            "persistent_client_expiration 1d",
            # VDA 5050 sends orders with QoS 0, which the broker would not keep for a robot that is away.
            "queue_qos0_messages true",
            "max_queued_messages 100",
            f"max_packet_size {LONGEST_PACKET_BYTES}",
            "log_dest stderr",
            "log_type error",
            "log_type warning",
            "log_type notice",
        ]
        if local:
            return "\n".join([*lines, f"listener {port} 127.0.0.1", "allow_anonymous true"]) + "\n"
        server = self.folder / "server"
        for authority, listener in (("robots", port), ("masters", port + 1)):
            lines += [
                f"listener {listener}",
                f"cafile {self._ca(authority) / 'ca.crt'}",
                f"certfile {server / 'server.crt'}",
                f"keyfile {server / 'server.key'}",
                "require_certificate true",
                "use_identity_as_username true",
            ]
            if authority == "robots":
                lines += ["use_username_as_clientid true", f"crlfile {self._ca('robots') / 'revoked.pem'}"]
        lines += ["allow_anonymous false", f"acl_file {self.folder / 'acl'}"]
        return "\n".join(lines) + "\n"


def acl_text() -> str:
    """Rules of mosquitto: interface and version, manufacturer, serial number, topic."""
    robots = [f"pattern write +/+/+/%u/{topic}" for topic in _OWN_WRITE]
    robots += [f"pattern read +/+/+/%u/{topic}" for topic in _OWN_READ]
    masters = [f"user {MASTER}", "topic read #"]
    masters += [f"topic write +/+/+/+/{topic}" for topic in _OWN_READ]
    return "\n".join([*masters, *robots]) + "\n"


def default_folder(environment: Mapping[str, str] = os.environ) -> Path:
    home = environment.get("XDG_DATA_HOME") or str(Path.home() / ".local" / "share")
    return Path(home) / "robot_stack" / "fleet"


def mosquitto() -> str:
    """Path of the program. Raises CommandError with the way to install it."""
    found = shutil.which("mosquitto") or next((place for place in _PLACES if os.access(place, os.X_OK)), None)
    if found is None:
        raise CommandError("mosquitto is not installed: `sudo apt install mosquitto`")
    return found


def _own_names() -> list[str]:
    addresses = [
        item.address.partition("%")[0]
        for items in psutil.net_if_addrs().values()
        for item in items
        if item.family in (socket.AF_INET, socket.AF_INET6)
    ]
    return ["localhost", socket.gethostname(), "127.0.0.1", "::1", *addresses]


def _alternative(name: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(name))
    except ValueError:
        return x509.DNSName(name)


def _name(common_name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])


def _builder(
    subject: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePublicKey, life: datetime.timedelta
) -> x509.CertificateBuilder:
    now = datetime.datetime.now(datetime.UTC)
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - _SLOW_CLOCK)
        .not_valid_after(now + life)
    )


def _usage(*, authority: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not authority,
        key_cert_sign=authority,
        crl_sign=authority,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _key_text(key: ec.EllipticCurvePrivateKey) -> str:
    return key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    ).decode()


def _certificate_text(certificate: x509.Certificate) -> str:
    return certificate.public_bytes(serialization.Encoding.PEM).decode()


def _write(path: Path, text: str) -> None:
    """Readable for its owner alone."""
    with writing(path):
        replace_file(path, text, mode=0o600)
