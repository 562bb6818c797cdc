"""`pip install ARGUMENTS` into the environment that runs this, in a tenth of the time.

uv does it, told what the configuration of pip says (a mirror, a folder of wheels, a certificate): whoever has
set up pip has set up this. Where uv cannot be had, or does not get to what pip finds, pip does it after all.
"""

import ast
import os
import subprocess
import sys
from pathlib import Path

PIP = [sys.executable, "-m", "pip", "--disable-pip-version-check"]
UV = Path(sys.executable).with_name("uv")
TOOLS_LOCK = Path(__file__).parents[1] / "requirements" / "tools.lock"

# pip's settings and uv's options of the same meaning. Several values are separated by blanks. Constraints are
# left out: what is installed here is pinned, and uv wants a hash of them too.
OPTIONS = {
    "index-url": "--default-index",
    "extra-index-url": "--index",
    "find-links": "--find-links",
    "trusted-host": "--allow-insecure-host",
}
# pip's settings that uv takes from its surroundings.
VARIABLES = {"cert": "SSL_CERT_FILE", "proxy": "ALL_PROXY"}


def pip_settings(listed: str) -> dict[str, str]:
    """What holds for `pip install`, from the lines of `pip config list` (`install.cert='/file'`).

    The environment's variables come before what is said of `install`, and that before what is said of all.
    """
    said: dict[str, dict[str, str]] = {"global": {}, "install": {}, ":env:": {}}
    for line in listed.splitlines():
        name, _, value = line.partition("=")
        section, _, key = name.rpartition(".")
        if section in said:
            said[section][key] = ast.literal_eval(value)
    return said["global"] | said["install"] | said[":env:"]


def uv_options(settings: dict[str, str]) -> list[str]:
    """The same settings for uv: of several indexes any may have the newest release, as with pip."""
    options = ["--index-strategy", "unsafe-best-match"]
    for key, option in OPTIONS.items():
        for value in settings.get(key, "").split():
            options += [option, value]
    if settings.get("no-index", "").lower() in ("1", "true", "yes", "on"):
        options.append("--no-index")
    return options


def install_with_uv(arguments: list[str]) -> bool:
    """Whether uv, which pip brings, has installed it."""
    if not UV.exists():
        subprocess.run(
            [*PIP, "install", "--quiet", "--require-hashes", "--requirement", str(TOOLS_LOCK)], check=False
        )
    if not UV.exists():
        return False
    listed = subprocess.run([*PIP, "config", "list"], check=True, capture_output=True, text=True).stdout
    settings = pip_settings(listed)
    surroundings = {VARIABLES[key]: settings[key] for key in VARIABLES if key in settings} | os.environ
    command = [str(UV), "pip", "install", "--quiet", "--python", sys.executable]
    installed = subprocess.run([*command, *uv_options(settings), *arguments], check=False, env=surroundings)
    return installed.returncode == 0


def main(arguments: list[str]) -> int:
    """Install by the one or the other; pip's status where it had to."""
    if install_with_uv(arguments):
        return 0
    print("without uv, by pip, which takes longer:", *arguments, file=sys.stderr)
    status = subprocess.run([*PIP, "install", "--quiet", *arguments], check=False).returncode
    if status != 0:
        print(
            "not installed: does 'pip config list' name what can be reached? Then once more", file=sys.stderr
        )
    return status


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except KeyboardInterrupt:
        sys.exit("interrupted: the same command goes on")
