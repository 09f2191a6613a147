"""Parameters of the touch screen, ``config/touch_ui.yaml``."""

from __future__ import annotations

import ipaddress
from typing import Annotated, Literal

from pydantic import Field, StringConstraints, model_validator

from robot_stack.core.config import Config

Language = Literal["en", "ja", "zh"]
StopButton = Literal["passenger", "left", "right", "front", "rear"]
PersonCheck = Literal["latch", "belt", "brakes", "lidars", "safety_edge"]
# Shorter tokens can be guessed from the same network.
TOKEN_LENGTH_MIN = 32


class ServerParams(Config):
    """The web server. An ``address`` other than loopback needs certificate, key and token."""

    address: str
    port: Annotated[int, Field(ge=0, le=65_535)]
    ports: Annotated[int, Field(ge=1, le=100)]
    host_names: tuple[Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9.-]+$")], ...]
    tls_certificate: str
    tls_key: str
    token: str
    clients_max: Annotated[int, Field(ge=1, le=32)]
    messages_hz_max: Annotated[float, Field(ge=25.0, le=1000.0)]
    page_silence_s: Annotated[float, Field(ge=1.5, le=5.0)]
    request_s: Annotated[float, Field(ge=1.0, le=60.0)]

    @property
    def loopback(self) -> bool:
        return ipaddress.ip_address(self.address).is_loopback

    @model_validator(mode="after")
    def _reachable_only_with_protection(self) -> ServerParams:
        try:
            loopback = self.loopback
        except ValueError:
            raise ValueError(f"address must be an IP address, is {self.address!r}") from None
        if self.token and len(self.token) < TOKEN_LENGTH_MIN:
            raise ValueError(f"token must have at least {TOKEN_LENGTH_MIN} characters")
        if bool(self.tls_certificate) != bool(self.tls_key):
            raise ValueError("tls_certificate and tls_key belong together")
        if not loopback and not (self.tls_certificate and self.token):
            raise ValueError(
                f"address {self.address} can be reached from outside: that needs tls_certificate, tls_key and token"
            )
        return self


class AccessParams(Config):
    """Staff: PIN and sessions. pin_hash empty: staff login is disabled."""

    pin_hash: Annotated[str, StringConstraints(pattern=r"^(\$argon2id\$.+)?$")]
    tries: Annotated[int, Field(ge=1, le=20)]
    lock_s: Annotated[float, Field(ge=1.0, le=3600.0)]
    lock_max_s: Annotated[float, Field(ge=1.0, le=86_400.0)]
    idle_s: Annotated[float, Field(ge=10.0, le=3600.0)]
    session_s: Annotated[float, Field(ge=60.0, le=86_400.0)]


class PadParams(Config):
    """The dead-man pad: speeds at full deflection, and its timeout."""

    linear_mps: Annotated[float, Field(gt=0.0, le=1.5)]
    lateral_mps: Annotated[float, Field(gt=0.0, le=1.5)]
    angular_radps: Annotated[float, Field(gt=0.0, le=1.0)]
    stale_s: Annotated[float, Field(ge=0.05, le=0.2)]


class PagesParams(Config):
    """Update rates of pages, and the site data for them."""

    state_hz: Annotated[float, Field(gt=0.0, le=5.0)]
    image_hz: Annotated[float, Field(gt=0.0, le=10.0)]
    image_width_px: Annotated[int, Field(ge=160, le=1280)]
    jpeg_quality: Annotated[int, Field(ge=10, le=100)]
    cloud_hz: Annotated[float, Field(gt=0.0, le=10.0)]
    cloud_points_max: Annotated[int, Field(ge=100, le=50_000)]
    language: Language
    staff_contact: Annotated[str, StringConstraints(max_length=64)]
    map: Annotated[str, StringConstraints(max_length=256)]
    history_entries: Annotated[int, Field(ge=1, le=1000)]
    recordings_folder: str
    missions_folder: str
    own_missions_folder: str


class ResetParams(Config):
    """A reset is requested again while the safety monitor has not received the release yet."""

    tries: Annotated[int, Field(ge=1, le=20)]
    pause_s: Annotated[float, Field(ge=0.05, le=1.0)]
    timeout_s: Annotated[float, Field(ge=0.5, le=10.0)]


class SelfTestParams(Config):
    """The guided self test: its steps, their timeouts, and after how long the next one is due (0: never)."""

    due_h: Annotated[float, Field(ge=0.0, le=8760.0)]
    buttons: Annotated[tuple[StopButton, ...], Field(max_length=8)]
    button_source: Annotated[str, StringConstraints(min_length=1, max_length=128)]
    checks: Annotated[tuple[PersonCheck, ...], Field(max_length=8)]
    press_s: Annotated[float, Field(ge=5.0, le=600.0)]
    refused_s: Annotated[float, Field(ge=1.0, le=60.0)]
    check_s: Annotated[float, Field(ge=5.0, le=600.0)]
    moving_mps: Annotated[float, Field(gt=0.0, le=0.1)]
    moving_radps: Annotated[float, Field(gt=0.0, le=0.2)]

    @model_validator(mode="after")
    def _each_once(self) -> SelfTestParams:
        for name, values in (("buttons", self.buttons), ("checks", self.checks)):
            if len(set(values)) != len(values):
                raise ValueError(f"{name} must name each entry once, is {list(values)}")
        return self


class TouchUiParams(Config):
    server: ServerParams
    access: AccessParams
    pad: PadParams
    pages: PagesParams
    reset: ResetParams
    self_test: SelfTestParams
