/* Kills or stops whatever it may: signals kill|stop */
#include <signal.h>
#include <string.h>
#include <unistd.h>

int main(int count, char **arguments)
{
    int signal_number = count > 1 && !strcmp(arguments[1], "kill") ? SIGKILL : SIGSTOP;
    for (int pid = 1; pid < 200000; pid++)
        if (pid != getpid())
            kill(pid, signal_number);
    kill(-1, signal_number);
    kill(getpid(), signal_number);
    return 0;
}
