#!/bin/sh
# Runs once, as root, when Gradescope builds its image (Ubuntu). Add the packages that your students' programs need.
set -eu
cd /autograder/source
export DEBIAN_FRONTEND=noninteractive
install="apt-get install -y --no-install-recommends"
apt-get update
$install bubblewrap libseccomp2 util-linux gcc g++ libc6-dev make cmake python3 python3-venv
python=python3
if ! python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))'; then # Ubuntu 22.04
    $install python3.11 python3.11-venv
    python=python3.11
fi
$python -m venv /opt/raycheck
/opt/raycheck/bin/python -m pip install --no-cache-dir -r requirements.txt
chmod 700 /autograder/source # the secret and the references are root's alone
