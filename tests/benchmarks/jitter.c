/* The peer of the streamer's cycle: a clock_nanosleep loop with nothing in it.
 * jitter PERIOD_NS COUNT: prints the lateness of each cycle in ns, one a line. */
#define _GNU_SOURCE
#include <errno.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <time.h>

static long long now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}

int main(int argc, char **argv)
{
    if (argc != 3)
        return 2;
    const long long period = atoll(argv[1]);
    const long count = atol(argv[2]);
    long long *late = calloc((size_t)count, sizeof *late);
    if (late == NULL)
        return 1;
    const struct sched_param priority = {.sched_priority = 60};
    sched_setscheduler(0, SCHED_FIFO, &priority); /* where permitted, as the streamer does */
    mlockall(MCL_CURRENT | MCL_FUTURE);
    prctl(PR_SET_TIMERSLACK, 1000UL, 0UL, 0UL, 0UL);
    long long deadline = now() + period;
    for (long i = 0; i < count; i++) {
        const struct timespec until = {deadline / 1000000000LL, deadline % 1000000000LL};
        while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL) == EINTR)
            ;
        late[i] = now() - deadline;
        deadline += period * (1 + late[i] / period); /* skipped to the schedule, as there */
    }
    for (long i = 0; i < count; i++)
        printf("%lld\n", late[i]);
    free(late);
    return 0;
}
