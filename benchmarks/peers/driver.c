/* Times contenders in turn: driver SECONDS ROWS PASS < jobs. A job is a line "LIBRARY IN IN_SIZE OUT OUT_SIZE ARGUMENT": a shared
   library with bench_open(argument) and bench_loop(n, in, in_size, out, out_size), a file of ROWS rows of doubles, and a file
   for the results. Prints for each job, in order, the least time of one row in ns.

   A pass is as many rows as fit into PASS ns, so that it mostly fits between two interruptions; where all of them take less, they
   are done again and again, so that everybody's code and constants are in the caches for most of a pass. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { MOST = 256 };

typedef void (*loop_function)(long, const double *, long, double *, long);

typedef struct {
    loop_function loop;
    double *in, *out, least;
    long in_size, out_size, rows, repeats;
} job;

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * t.tv_sec + t.tv_nsec;
}

static void fail(const char *what, const char *of)
{
    fprintf(stderr, "driver: %s: %s\n", what, of);
    exit(1);
}

static job opened(long rows, double passing, char *library, char *in, long in_size, char *out, long out_size, char *argument)
{
    job made = {.in_size = in_size, .out_size = out_size, .rows = rows, .least = 1e300};
    void *handle = dlopen(library, RTLD_NOW | RTLD_LOCAL);
    if (!handle) fail("dlopen", dlerror());
    int (*open)(const char *) = (int (*)(const char *))dlsym(handle, "bench_open");
    made.loop = (loop_function)dlsym(handle, "bench_loop");
    if (!open || !made.loop || open(argument)) fail("not opened", library);
    made.in = aligned_alloc(64, (size_t)(rows * in_size + 8) * 8 / 64 * 64 + 64);
    made.out = aligned_alloc(64, (size_t)(rows * out_size + 8) * 8 / 64 * 64 + 64);
    memset(made.out, 0, (size_t)(rows * out_size) * 8);
    FILE *file = fopen(in, "rb");
    if (!file || (long)fread(made.in, 8, (size_t)(rows * in_size), file) != rows * in_size) fail("states", in);
    fclose(file);
    double start = now();
    made.loop(rows, made.in, in_size, made.out, out_size);
    double each = (now() - start) / rows;
    start = now(); /* again: warm */
    made.loop(rows, made.in, in_size, made.out, out_size);
    each = (now() - start) / rows < each ? (now() - start) / rows : each;
    file = fopen(out, "wb");
    if (!file || (long)fwrite(made.out, 8, (size_t)(rows * out_size), file) != rows * out_size) fail("results", out);
    fclose(file);
    long fitting = (long)(passing / each) / 8 * 8;
    made.rows = fitting > rows ? rows : fitting < 8 ? 8 : fitting;
    made.repeats = fitting > rows ? fitting / rows : 1;
    return made;
}

int main(int argc, char **argv)
{
    static job jobs[MOST];
    char library[1024], in[1024], out[1024], argument[2048];
    long in_size, out_size, rows = atol(argv[2]);
    int n = 0;
    if (argc != 4) fail("wants", "SECONDS ROWS PASS");
    while (n < MOST && scanf("%1023s %1023s %ld %1023s %ld %2047[^\n]", library, in, &in_size, out, &out_size, argument) == 6)
        jobs[n++] = opened(rows, atof(argv[3]), library, in, in_size, out, out_size, argument);
    double end = now() + 1e9 * atof(argv[1]);
    for (long round = 0; (round < 20 || now() < end) && n; round++)
        for (int i = 0; i < n; i++) {
            job *j = &jobs[i];
            double start = now();
            for (long k = 0; k < j->repeats; k++) j->loop(j->rows, j->in, j->in_size, j->out, j->out_size);
            double each = (now() - start) / j->rows / j->repeats;
            if (each < j->least) j->least = each;
        }
    for (int i = 0; i < n; i++) printf("%.17g\n", jobs[i].least);
    return 0;
}
