/* What one core can do: independent chains of additions and of fused multiply-adds, as many as there are registers.
   bench_open("add", "fma" or "both"); a "row" is STEPS steps of all chains. REAL is double or a vector of them. */
#include <string.h>

#ifndef LANES
typedef double real;
#define SPREAD(x) (x)
#else
typedef double real __attribute__((vector_size(8 * LANES)));
#define SPREAD(x) ((real){0} + (x))
#endif
#define HOLD(x) __asm__ volatile("" : "+x"(x))

enum { STEPS = 64 };
static int kind;

int bench_open(const char *argument)
{
    kind = !strcmp(argument, "add") ? 0 : !strcmp(argument, "fma") ? 1 : 2;
    return 0;
}

#define A(k) a##k += c; HOLD(a##k);
#define F(k) f##k = f##k * b + c; HOLD(f##k);
#define START(x) real x = SPREAD(in[0]); HOLD(x);
#if defined(__AVX512F__) /* 32 registers: twenty chains */
#define ADDS(X) X(0) X(1) X(2) X(3) X(4) X(5) X(6) X(7) X(8) X(9) X(10) X(11) X(12) X(13) X(14) X(15) X(16) X(17) X(18) X(19)
#define HALF(X) X(0) X(1) X(2) X(3) X(4) X(5) X(6) X(7) X(8) X(9)
#define FIRST(X) HALF(X)
enum { MOST = 20, OF_EACH = 10, FUSED = 10 };
#else /* 16: twelve chains; of both, eight of the longer latency and six of the shorter */
#define ADDS(X) X(0) X(1) X(2) X(3) X(4) X(5) X(6) X(7) X(8) X(9) X(10) X(11)
#define HALF(X) X(0) X(1) X(2) X(3) X(4) X(5)
#define FIRST(X) X(0) X(1) X(2) X(3) X(4) X(5) X(6) X(7)
enum { MOST = 12, OF_EACH = 6, FUSED = 8 };
#endif
#define START_A(k) START(a##k)
#define START_F(k) START(f##k)

static __attribute__((noinline)) void adds(const double *in)
{
    real c = SPREAD(in[1]);
    ADDS(START_A)
    for (int i = 0; i < STEPS; i++) { ADDS(A) }
}

static __attribute__((noinline)) void fused(const double *in)
{
    real b = SPREAD(in[0]), c = SPREAD(in[1]);
    ADDS(START_F)
    for (int i = 0; i < STEPS; i++) { ADDS(F) }
}

static __attribute__((noinline)) void both(const double *in)
{
    real b = SPREAD(in[0]), c = SPREAD(in[1]);
    HALF(START_A)
    FIRST(START_F)
    for (int i = 0; i < STEPS; i++) { FIRST(F) HALF(A) }
}

void bench_loop(long n, const double *in, long in_size, double *out, long out_size)
{
    void (*const chains)(const double *) = kind == 0 ? adds : kind == 1 ? fused : both;
    const int lanes = sizeof(real) / 8;
    for (long i = 0; i < n; i++, in += in_size, out += out_size) {
        chains(in);
        out[0] = (double)STEPS * lanes * (kind == 0 ? MOST : kind == 1 ? 2 * MOST : OF_EACH + 2 * FUSED); /* flop */
    }
}
