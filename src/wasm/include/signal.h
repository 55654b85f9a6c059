/* WebAssembly has no signals: none is ever heeded. */
#pragma once

#include <stdlib.h>

typedef int sig_atomic_t;
typedef int sigset_t;
struct sigaction {
    void (*sa_handler)(int);
    int sa_flags;
    sigset_t sa_mask;
};
enum { SIGHUP = 1, SIGINT, SIGPIPE, SIGTERM, SIGXFSZ, SA_RESTART = 0 };
#define SIG_DFL ((void (*)(int))0)
#define SIG_IGN ((void (*)(int))1)
#define signal(number, handler) ((void)(number), (void)(handler))
#define sigaction(number, now, ours) ((void)(number), (void)(now), (void)(ours), -1)
#define sigemptyset(set) ((void)(set))
#define raise(number) exit(128 + (number))
