/* Whole simulations in a loop without Python. Included after `static int once(double setting, double *end)`, which runs one from its
   start to its end, at a tolerance or in a number of steps, writes the state there and returns nonzero where it stops early. */
#include <time.h>

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e3 * t.tv_sec + 1e-6 * t.tv_nsec;
}

/* The least time in ms of `repeats` runs; negative where one stops early. */
double whole(double setting, long repeats, double *end)
{
    double least = 1e300;
    for (long i = 0; i < repeats; i++) {
        const double begin = now();
        if (once(setting, end))
            return -1.0;
        const double took = now() - begin;
        least = took < least ? took : least;
    }
    return least;
}
