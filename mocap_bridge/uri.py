"""Mocap URIs, such as ``vicon://HOST[:PORT]?subject=NAME``; every kind is a row of :data:`SCHEMES`.

A simulated lab that keeps its own time adds ``&time=HOST:PORT`` (:mod:`onboard.lab_time`).
"""

from dataclasses import dataclass
from urllib.parse import SplitResult, parse_qsl, quote, unquote, urlsplit

from mocap_bridge.errors import MocapUriError, SourceBroken
from mocap_bridge.whose_bug import blamed_on_the_source
from onboard.lab_time.address import OPTION as TIME_OPTION

# Anybody could send an object stream, so only this computer is heard unless the URI says more.
LOOPBACK = "127.0.0.1"
SUBJECT_NAME_LIMIT = 100


@dataclass(frozen=True, slots=True)
class MocapScheme:
    """One kind of address.

    Attributes:
        opener: ``module.function`` that opens it (:func:`mocap_bridge.pose.open_pose_stream`), imported then.
        port: where the port is left out.
        example: a right one, for messages.
        needs_host: whether the host must be given; else :data:`LOOPBACK` is listened on.
        subject: what is meant where the URI names no subject; None: it must.
        options: what else may follow the question mark.
        is_file: the address is the path of a file, without host and port.
        live: what it gives happens now; nobody flies by anything else.
    """

    opener: str
    port: int
    example: str
    needs_host: bool
    subject: str | None = None
    options: tuple[str, ...] = ()
    is_file: bool = False
    live: bool = True


SCHEMES: dict[str, MocapScheme] = {
    "vicon": MocapScheme(
        opener="mocap_bridge.sources.vicon.open_vicon",
        port=801,
        example="vicon://192.168.1.10?subject=cf1",
        needs_host=True,
    ),
    "vicon-udp": MocapScheme(
        opener="mocap_bridge.sources.vicon_udp.open_vicon_udp",
        port=51001,
        example="vicon-udp://:51001?subject=cf1",
        needs_host=False,
    ),
    "mavlink": MocapScheme(
        opener="mocap_bridge.sources.mavlink.open_mavlink",
        port=14551,
        example="mavlink://:14551?subject=1",
        needs_host=False,
        subject="any",
        options=("key",),
    ),
    "file": MocapScheme(
        opener="mocap_bridge.sources.recording.open_recording",
        port=0,
        example="file:///data/runs/RUN",
        needs_host=False,
        subject="recorded",
        is_file=True,
        live=False,
    ),
    **{
        f"motioncapture+{kind}": MocapScheme(
            opener="mocap_bridge.sources.motioncapture.open_motioncapture",
            port=port,
            example=f"motioncapture+{kind}://192.168.1.10?subject=cf1",
            needs_host=True,
        )
        for kind, port in (("optitrack", 1510), ("qualisys", 22222), ("vicon", 801), ("vrpn", 3883))
    },
}
"""Every mocap source of ours, by the scheme of its addresses; ports from the vendor's manuals."""

ENTRY_POINTS = "perchhw.mocap"
"""Group of the entry points by which other packages bring theirs: ``SCHEME = "module:a_mocap_scheme"``."""


@dataclass(frozen=True, slots=True)
class MocapUri:
    """A parsed mocap address.

    Attributes:
        scheme: one of :data:`SCHEMES`, or of an installed package.
        host: the server; where none is needed the local address to listen on, the loopback unless given
            ("0.0.0.0" is all of this computer's).
        port: TCP or UDP port.
        subject: name of the body.
        path: of the file, where the scheme is of files.
        options: further options, as (name, value).
    """

    scheme: str
    host: str
    port: int
    subject: str
    path: str = ""
    options: tuple[tuple[str, str], ...] = ()

    def option(self, name: str) -> str | None:
        """The value of a further option."""
        return dict(self.options).get(name)

    def __str__(self) -> str:
        if self.path:
            return f"{self.scheme}://{quote(self.path)}?subject={quote(self.subject)}"
        host = f"[{self.host}]" if ":" in self.host else self.host
        further = "".join(f"&{name}={quote(value)}" for name, value in self.options)
        return f"{self.scheme}://{host}:{self.port}?subject={quote(self.subject)}{further}"


def address_forms() -> tuple[str, ...]:
    """How addresses of :data:`SCHEMES` are written, for help; kinds that differ behind a plus are one."""
    forms = []
    for name, scheme in SCHEMES.items():
        family, plus, _ = name.partition("+")
        where = "PATH" if scheme.is_file else "HOST[:PORT]" if scheme.needs_host else "[ADDRESS][:PORT]"
        subject = "?subject=NAME" if scheme.subject is None else ""
        forms.append(f"{family}{'+TYPE' if plus else ''}://{where}{subject}")
    return tuple(dict.fromkeys(forms))


def scheme_of(name: str) -> MocapScheme | None:
    """The kind of address with this scheme, ours or that of an installed package; None: nobody's.

    Raises:
        MocapUriError: the package that brings it is broken.
    """
    if name in SCHEMES:
        return SCHEMES[name]
    from importlib.metadata import entry_points

    for point in entry_points(group=ENTRY_POINTS, name=name):
        package = point.dist.name if point.dist is not None else point.module
        try:
            with blamed_on_the_source():
                scheme = point.load()
        except SourceBroken as error:
            raise MocapUriError(f"mocap source {name!r} of the package {package}: {error}") from error
        if not isinstance(scheme, MocapScheme):
            raise MocapUriError(
                f"mocap source {name!r} of the package {package}: {point.value} is no MocapScheme"
            )
        return scheme
    return None


def _installed() -> list[str]:
    """Schemes that installed packages bring."""
    from importlib.metadata import entry_points

    return sorted(entry_points(group=ENTRY_POINTS).names)


def parse_mocap_uri(text: str) -> MocapUri:
    """Parse `text`.

    Raises:
        MocapUriError: unknown scheme, host or subject missing, bad port, unknown option.
    """
    try:
        parts = urlsplit(text)
        port = parts.port
        host = parts.hostname or ""
        options = parse_qsl(parts.query, keep_blank_values=True, strict_parsing=bool(parts.query))
    except ValueError as error:
        example = SCHEMES["vicon"].example
        raise MocapUriError(f"mocap URI {text!r}: {error}; write e.g. {example}") from error
    scheme = scheme_of(parts.scheme)
    if scheme is None:
        known = [scheme.example for scheme in SCHEMES.values()] + [f"{name}://..." for name in _installed()]
        raise MocapUriError(
            f"mocap URI {text!r}: unknown scheme {parts.scheme!r}; write one of: {', '.join(known)}"
        )
    example = scheme.example
    subject = _subject(text, options, scheme)
    if scheme.is_file:
        return MocapUri(parts.scheme, "", 0, subject, _path(text, parts, example))
    if parts.username or parts.password or parts.path not in ("", "/") or parts.fragment:
        raise MocapUriError(
            f"mocap URI {text!r}: only host, port and ?subject= are allowed; write e.g. {example}"
        )
    if not host and scheme.needs_host:
        raise MocapUriError(f"mocap URI {text!r}: the host is missing; write e.g. {example}")
    if port == 0:
        raise MocapUriError(f"mocap URI {text!r}: port 0 is not an address; write e.g. {example}")
    further = tuple((key, value) for key, value in options if key in scheme.options)
    return MocapUri(parts.scheme, host or LOOPBACK, port or scheme.port, subject, options=further)


def is_live(text: str) -> bool:
    """Whether what `text` gives happens now; also of what is no address, which others refuse."""
    scheme = scheme_of(text.partition("://")[0].lower())
    return scheme is None or scheme.live


def _path(text: str, parts: SplitResult, example: str) -> str:
    """The path of a file: absolute, or as it is written after two slashes."""
    path = unquote(parts.netloc + parts.path)
    if not path or parts.fragment:
        raise MocapUriError(f"mocap URI {text!r}: the path of a file is missing; write e.g. {example}")
    return path


def _subject(text: str, options: list[tuple[str, str]], scheme: MocapScheme) -> str:
    known = ("subject", *scheme.options)
    unknown = [key for key, _ in options if key not in (*known, TIME_OPTION)]
    if unknown:
        raise MocapUriError(
            f"mocap URI {text!r}: unknown option {unknown[0]!r}; only {' and '.join(known)} is known"
        )
    names = [value for key, value in options if key == "subject"]
    if not names and scheme.subject is not None:
        return scheme.subject
    if len(names) != 1 or not names[0]:
        raise MocapUriError(f"mocap URI {text!r}: name exactly one subject; write e.g. {scheme.example}")
    if len(names[0]) > SUBJECT_NAME_LIMIT or not names[0].isprintable():
        raise MocapUriError(
            f"mocap URI {text!r}: the subject is not a printable name of at most 100 characters"
        )
    return names[0]
