"""Decodes frames by cantools, an implementation of its own, for tests/dbc_oracle.rs.

usage: cantools_oracle.py VENV DBC FRAMES

Makes the virtual environment VENV with cantools in it where it is not there yet, then decodes the lines of FRAMES
(message name, a space, payload in hexadecimal) by DBC. One JSON object a line: {signal: value}, or
{"error": text} where cantools refuses the frame (a multiplexor value without signals).
"""

import json
import os
import subprocess
import sys
import venv

VERSION = "45.1.0"


def inside(environment):
    """Runs this script again by the environment's own interpreter, which has cantools."""
    python = os.path.join(environment, "bin", "python")
    probe = [python, "-c", "import cantools, sys; sys.exit(cantools.__version__ != sys.argv[1])", VERSION]
    if not os.path.exists(python) or subprocess.run(probe, capture_output=True).returncode != 0:
        venv.create(environment, with_pip=True, clear=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", f"cantools=={VERSION}"], check=True, stdout=sys.stderr)
    return subprocess.run([python, __file__, "--decode", *sys.argv[2:]]).returncode


def decode(dbc, frames):
    import cantools

    database = cantools.database.load_file(dbc, strict=False)
    with open(frames) as lines:
        for line in lines:
            name, _, payload = line.rstrip("\n").partition(" ")
            message = database.get_message_by_name(name)
            try:
                values = message.decode(bytes.fromhex(payload), decode_choices=False, allow_excess=True)
                print(json.dumps({key: float(value) for key, value in values.items()}))
            except Exception as error:
                print(json.dumps({"error": str(error)}))


if __name__ == "__main__":
    if sys.argv[1] == "--decode":
        decode(*sys.argv[2:])
    else:
        sys.exit(inside(sys.argv[1]))
