/* Asks for the answer over the network; exit status 9 is a success of the attack. */
#include <arpa/inet.h>
#include <netinet/in.h>
#include <stdio.h>
#include <sys/socket.h>
#include <unistd.h>

static int reaches(const char *address, int port)
{
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons((unsigned short)port)};
    int s = socket(AF_INET, SOCK_STREAM, 0);
    return s >= 0 && inet_pton(AF_INET, address, &to.sin_addr) == 1
        && connect(s, (struct sockaddr *)&to, sizeof to) == 0;
}

int main(void)
{
    if (reaches("1.1.1.1", 443) || reaches("8.8.8.8", 53) || reaches("127.0.0.1", 22))
        return 9;
    fprintf(stderr, "no network\n");
    return 5;
}
