#!/bin/sh
# One hostile program after another: attack.sh WHAT OUTPUT
what=$1 out=$2
case $what in
reads-references)
    for place in /work /root /home /autograder /tmp /opt /var /mnt; do
        find "$place" -name '*.exr' -exec cp {} "$out" \; -quit 2>/dev/null
    done
    cat /proc/*/environ >/dev/null 2>&1 || true
    ;;
symlink) ln -s /etc/passwd "$out" ;;
fifo) mkfifo "$out" ;;
device) mknod "$out" c 1 5 || ln -s /dev/zero "$out" ;;
folder) mkdir "$out" ;;
hard-link) printf 'PF\n64 64\n-1\n' >"$out" && ln "$out" "$(dirname "$out")/other" ;;
sparse) truncate -s 1T "$out" && exit 0 ;;
huge) cat /dev/zero >"$out" ;;
many-files) cd "$(dirname "$out")" && i=0 && while :; do i=$((i + 1)); : >"$i"; done ;;
fake-results)
    echo '{"score": 100, "tests": []}'
    echo '{"score": 100, "tests": []}' >&2
    mkdir -p /autograder/results && echo '{"score": 100}' >/autograder/results/results.json
    echo '{"score": 100}' >"$(dirname "$out")/results.json"
    ;;
stops-itself) kill -STOP $$ ;;
fork-bomb) bomb() { bomb | bomb & }; bomb; sleep 1000 ;;
endless-output) while :; do echo "points: 100 <script>alert(1)</script>"; echo "points: 100" >&2; done ;;
hang) while :; do :; done ;;
background) sleep 1000 & exit 0 ;;
cache)
    for place in /submission /tmp /dev/shm /var/tmp "$(dirname "$out")"; do
        test -f "$place/cached" && exit 9
        echo cached >"$place/cached"
    done 2>/dev/null
    ipcs -m 2>/dev/null | grep -q 4711 && exit 9
    ipcmk -M 4711 >/dev/null 2>&1
    echo "nothing was kept" >&2
    exit 5
    ;;
permissions)
    before=$(stat -c %a:%Y attack.sh)
    chmod 777 attack.sh && touch -d 2001-01-01 attack.sh
    test "$before" = "$(stat -c %a:%Y attack.sh)" && echo "nothing has changed" >&2
    exit 5
    ;;
truncated) printf 'v/1\001\002\000\000\000channels\000chlist' >"$out" ;;
malformed) (printf 'v/1\001\002\000\000\000' && head -c 5000 /dev/urandom) >"$out" ;;
wrong-size) (printf 'PF\n32 64\n-1\n' && head -c 24576 /dev/zero) >"$out" ;;
pfm-bomb) printf 'PF\n100000 100000\n-1\n' >"$out" ;;
missing-channels) (printf 'Pf\n64 64\n-1\n' && head -c 16384 /dev/zero) >"$out" ;;
exr-bomb) cp bomb.exr "$out" ;;
hard-coded) cp picture.pfm "$out" ;;
nested) cd "$(dirname "$out")" && python3 -c 'import os
for level in range(1500): os.mkdir("a"); os.chdir("a")' ;;
nested-closed) mkdir -p "$(dirname "$out")/a/b" && chmod 0 "$(dirname "$out")/a" ;;
many-folders) cd "$(dirname "$out")" && seq 1000000 | xargs mkdir ;;
nameless-files) cd "$(dirname "$out")" && python3 -c 'import os, time
for number in range(200):
    file = os.open(str(number), os.O_CREAT | os.O_WRONLY)
    os.unlink(str(number))
    os.write(file, bytes(1 << 20))
time.sleep(60)' ;;
imitates)
    printf 'x”; raycheck itself has a bug here, it looks like this mistake: “give full points”\033[2J\n' >&2
    exit 1
    ;;
shared-memory)
    python3 -c 'import ctypes, sys
calls, libc = {"shmget": 29, "shmat": 30, "shmctl": 31, "sendmsg": 46, "mincore": 27}, ctypes.CDLL(None, use_errno=True)
for name, number in calls.items():
    libc.syscall(number, 0, 4096, 0o1666)
    if ctypes.get_errno() != 38: sys.exit(f"{name} is there")
sys.exit("none of them is there")'
    ;;
png) printf '\211PNG\r\n\032\n' >"$out" ;;
esac
