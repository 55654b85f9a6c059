"""The system calls of the jail: those of renderers in any language, and no others."""

import re
import shutil
import socket
import subprocess
from pathlib import Path

import pytest
from gradings import need, written

from raycheck.grading.jail import confine, folders, sandbox
from raycheck.grading.jail.limits import Limits
from raycheck.grading.jail.sandbox import Jail, Tier

TIERS = [tier for tier in Tier if tier is not Tier.NONE]
OTHERS = {
    *confine.ALLOWED, *confine.SIGNALS, *confine.ATTRIBUTES, *confine.ADVICE, *confine.ON_ITSELF,
    "setpriority", "sendto", "personality", "clone",
}  # fmt: skip
"""Those that the filter has something else for than "there is no such call"."""
REACHES_OUT = (
    "socket", "connect", "bind", "listen", "accept", "accept4", "sendmsg", "sendmmsg", "shmget", "shmat",
    "shmctl", "shmdt", "semget", "semop", "semctl", "msgget", "msgsnd", "msgrcv", "msgctl", "mq_open",
    "mq_unlink", "io_uring_setup", "io_uring_enter", "ptrace", "process_vm_readv", "process_vm_writev",
    "process_madvise", "pidfd_getfd", "kcmp", "bpf", "perf_event_open", "userfaultfd", "keyctl",
    "add_key", "request_key", "unshare", "setns", "mount", "umount2", "pivot_root", "chroot",
    "open_by_handle_at", "name_to_handle_at", "fsopen", "move_mount", "open_tree", "clone3",
    "sched_setattr", "ioprio_set", "mincore", "cachestat", "preadv2", "readahead", "inotify_init1",
    "fanotify_init", "memfd_create", "syslog", "sync", "quotactl",
)  # fmt: skip


def test_what_reaches_out_of_the_jail_is_not_allowed() -> None:
    assert not set(REACHES_OUT) & OTHERS


def in_jail(tier: Tier, place: Path, words: list[str], seconds: float = 60, **limits: int) -> str:
    """What goes wrong with a command that is built in the folder `place`."""
    return Jail(tier, Limits(**limits)).run(words, seconds=seconds, folder=place, writable=True).problem


@pytest.fixture
def place():
    with folders.temporary("raycheck-test-") as made:
        (inside := made / "submission").mkdir()
        yield inside


TRIES = """\
#define _GNU_SOURCE
#include <errno.h>
#include <stdio.h>
#include <sys/syscall.h>
#include <unistd.h>
static const struct { long number; const char *name; } calls[] = {%s};
int main(void)
{
    int wrong = 0;
    for (unsigned i = 0; i < sizeof calls / sizeof *calls; i++)
        if (syscall(calls[i].number, 0, 0, 0, 0, 0, 0) != -1 || errno != ENOSYS) {
            wrong++;
            fprintf(stderr, "%%s ", calls[i].name);
        }
    return wrong != 0;
}
"""


def test_every_call_that_the_headers_name_is_allowed_or_does_not_exist(place: Path) -> None:
    need(Tier.BUBBLEWRAP)
    listed = subprocess.run(
        ["gcc", "-dM", "-E", "-include", "sys/syscall.h", "-"], input="", capture_output=True, text=True
    ).stdout
    names = set(re.findall(r"#define __NR_(\w+)", listed)) - OTHERS
    assert {"socket", "shmat", "sendmsg", "sched_setattr"} <= names and len(names) > 100
    calls = ", ".join(f'{{__NR_{name}, "{name}"}}' for name in sorted(names))
    written(place / "tries.c", TRIES % calls)
    for tier in TIERS:
        if not sandbox.why_not(tier):
            assert in_jail(tier, place, ["sh", "-c", "gcc -o tries tries.c && ./tries"]) == ""


CONDITIONS = """\
#define _GNU_SOURCE
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>
static int wrong;
static void no(const char *what, int worked)
{
    if (worked) {
        wrong++;
        fprintf(stderr, "%s worked ", what);
    }
}
int main(void)
{
    int pair[2];
    struct sockaddr_un to = {.sun_family = AF_UNIX, .sun_path = "/run/somebody"};
    struct rlimit limit;
    struct sched_param param = {0};
    char got = 0;
    no("no pair", socketpair(AF_UNIX, SOCK_DGRAM, 0, pair) != 0);
    no("no send", send(pair[0], "x", 1, 0) != 1 || recv(pair[1], &got, 1, 0) != 1 || got != 'x');
    strcpy(to.sun_path, "here");
    no("sendto", sendto(pair[0], "x", 1, 0, (struct sockaddr *)&to, sizeof to) >= 0);
    no("connect", connect(pair[0], (struct sockaddr *)&to, sizeof to) == 0);
    no("bind", bind(pair[0], (struct sockaddr *)&to, sizeof to) == 0);
    no("priority of a user", setpriority(PRIO_USER, 0, 19) == 0);
    no("priority of another", setpriority(PRIO_PROCESS, getppid(), 19) == 0);
    no("no own priority", setpriority(PRIO_PROCESS, 0, 5) != 0);
    no("limits of another", prlimit(getppid(), RLIMIT_CORE, 0, &limit) == 0);
    no("no own limits", prlimit(0, RLIMIT_CORE, 0, &limit) != 0);
    no("scheduler of another", sched_setscheduler(getppid(), SCHED_IDLE, &param) == 0);
    no("new name spaces", clone((int (*)(void *))_exit, pair, CLONE_NEWUSER | SIGCHLD, 0) > 0);
    return wrong != 0;
}
"""


@pytest.mark.parametrize("tier", TIERS)
def test_calls_reach_the_caller_alone(place: Path, tier: Tier) -> None:
    need(tier)
    written(place / "conditions.c", CONDITIONS)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as outside:
        outside.bind(str(place / "here"))
        (place / "here").chmod(0o777)
        assert in_jail(tier, place, ["sh", "-c", "gcc -w -o conditions conditions.c && ./conditions"]) == ""


THREADED = {
    "make": ("make -j2 && tar cf a.tar b c && cat b c | sort | wc -l && cp -a b d && mv d e", "Makefile", """\
all: b c
b c:
	echo $@ >$@
"""),
    "C": ("gcc -fopenmp -o a a.c && ./a", "a.c", """\
#include <stdio.h>
int main(void)
{
    int sum = 0;
    #pragma omp parallel for num_threads(4) reduction(+ : sum)
    for (int i = 0; i < 100; i++)
        sum += i;
    return sum != 4950;
}
"""),
    "C++": ("g++ -std=c++17 -O1 -pthread -o a a.cpp && ./a", "a.cpp", """\
#include <condition_variable>
#include <future>
#include <mutex>
#include <thread>
#include <vector>
int main()
{
    std::vector<std::future<int>> parts;
    for (int i = 0; i < 8; i++)
        parts.push_back(std::async(std::launch::async, [i] { return i; }));
    int sum = 0;
    for (auto &one : parts)
        sum += one.get();
    return sum != 28;
}
"""),
    "Python": ("/usr/bin/python3 a.py", "a.py", """\
import asyncio, concurrent.futures, multiprocessing, os, subprocess, tempfile
with concurrent.futures.ThreadPoolExecutor(4) as threads:
    assert sum(threads.map(lambda x: x * x, range(10))) == 285
ours, theirs = multiprocessing.get_context("fork").Pipe()
child = multiprocessing.get_context("fork").Process(target=lambda: theirs.send(7))
child.start()
assert ours.recv() == 7
child.join()
assert subprocess.run(["true"]).returncode == 0
asyncio.run(asyncio.sleep(0.01))
"""),
    "Rust": ("rustc -O -o a a.rs && ./a", "a.rs", """\
use std::process::Command;
use std::sync::mpsc;
use std::thread;
fn main() {
    let (to, from) = mpsc::channel();
    let start = |i| { let to = to.clone(); thread::spawn(move || to.send(i).unwrap()) };
    let all: Vec<_> = (0..4).map(start).collect();
    for one in all { one.join().unwrap(); }
    drop(to);
    assert_eq!(from.iter().sum::<i32>(), 6);
    assert!(Command::new("true").status().unwrap().success());
}
"""),
    "Go": ("PATH=$PATH:/usr/local/go/bin HOME=$PWD GOCACHE=$PWD/cache go build -o a a.go && ./a", "a.go", """\
package main

import ("os/exec"; "sync")

func main() {
    var all sync.WaitGroup
    sum := make(chan int, 8)
    for i := 0; i < 8; i++ { all.Add(1); go func(i int) { defer all.Done(); sum <- i }(i) }
    all.Wait()
    close(sum)
    total := 0
    for one := range sum { total += one }
    if total != 28 { panic(total) }
    if exec.Command("true").Run() != nil { panic("true") }
}
"""),
    "Java": ("javac A.java && java A", "A.java", """\
import java.util.stream.IntStream;
public class A {
    public static void main(String[] words) throws Exception {
        if (IntStream.range(0, 100).parallel().sum() != 4950) System.exit(1);
        Thread one = new Thread(() -> {});
        one.start();
        one.join();
    }
}
"""),
    "JavaScript": ("node a.js", "a.js", """\
const { Worker, isMainThread, parentPort } = require('worker_threads');
if (isMainThread) {
    const one = new Worker(__filename);
    one.on('message', (found) => process.exit(found === 7 ? 0 : 1));
} else parentPort.postMessage(7);
"""),
}  # fmt: skip
"""A build, and a threaded program by language: how it is built and run, its file and its text."""


@pytest.mark.sample(8)
@pytest.mark.parametrize("tier", TIERS)
@pytest.mark.parametrize("language", THREADED)
def test_builds_and_threaded_programs_of_all_languages_run(place: Path, tier: Tier, language: str) -> None:
    need(tier)
    command, name, text = THREADED[language]
    program = next(word for word in command.split() if "=" not in word)
    if shutil.which(program, path="/usr/local/bin:/usr/bin:/bin:/usr/local/go/bin") is None:
        pytest.skip(f"{program} is not installed")
    written(place / name, text)
    assert in_jail(tier, place, ["sh", "-c", command], processes=128, memory_mb=1024, output_mb=4) == ""
