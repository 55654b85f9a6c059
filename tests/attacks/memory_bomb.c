/* Takes memory until something stops it: memory_bomb PROCESSES MEGABYTES_EACH */
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

int main(int count, char **arguments)
{
    if (count < 3)
        return 1;
    for (int i = 1; i < atoi(arguments[1]); i++)
        if (fork() == 0)
            break;
    for (int i = 0; i < atoi(arguments[2]); i++) {
        char *block = malloc(1 << 20);
        if (!block)
            return 7;
        memset(block, 1, 1 << 20);
    }
    sleep(1000);
    return 0;
}
