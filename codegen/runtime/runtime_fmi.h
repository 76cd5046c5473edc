/* An FMU for Model Exchange and Co-Simulation, FMI 3.0: instances, modes and values; `model` says what it is an FMU of.

   All that a motion consists of lies in one block of bytes without pointers, so that FMU states are copies of it. Nothing is shared
   between instances. A call that the standard does not allow in the mode at hand changes nothing and returns fmi3Error.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { EXCHANGE = 1, SIMULATION = 2 };
enum { INSTANTIATED = 1, INITIALIZATION = 2, EVENT_MODE = 4, CONTINUOUS = 8, STEP = 16, TERMINATED = 32 };
enum { INITIALIZED = EVENT_MODE | CONTINUOUS | STEP, READABLE = INITIALIZATION | INITIALIZED | TERMINATED, ANY = 63 };
enum { STATE_VERSION = 2 };
static const double SOON = 1e-11; /* of a time and a step: finer than that importers need not find an event */
static const double PROJECTED_FROM = 10.0; /* relative tolerances: violations of constraints above ask for a projection */

/* What a motion consists of, before its numbers. */
typedef struct {
    char token[40]; /* of the model */
    int32_t version, kind, mode;
    int32_t settled; /* is x consistent with the start values? */
    int32_t moving;  /* has the simulation begun? */
    int32_t new_u, new_p; /* set since the last step, or the last event */
    int32_t has_stop;
    double t, stop, rtol, atol;
    double seen, step; /* Model Exchange: the time of the last completed step, and its length */
} Head;

typedef struct {
    Head *head; /* the block: Head, then the numbers below, then the motion on its way */
    double *x, *given, *u, *p, *sign; /* the state, its start values, inputs, parameters, sides of the events */
    void *simulation;
    double *rates, *values; /* of the variables, as far as `known` says */
    int *known;
    double *seed, *result; /* of derivatives */
    double *reserve; /* a state to try */
    char *name;
    int logging, may_return_early;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} Instance;

/* ---- messages */

static fmi3Status say(const Instance *i, fmi3Status status, const char *format, ...)
{
    char text[400];
    va_list arguments;
    if (!i->logging || !i->log)
        return status;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    i->log(i->environment, status, status == fmi3Warning ? "logStatusWarning" : "logStatusError", text);
    return status;
}

/* Whether a call is allowed in this kind of instance and this mode. */
static int allowed(const Instance *i, const char *call, int kinds, int modes)
{
    static const char *const names[] = {"Instantiated", "Initialization Mode", "Event Mode", "Continuous-Time Mode", "Step Mode", "Terminated"};
    int k = 0;
    if (!i)
        return 0;
    if (!(i->head->kind & kinds)) {
        say(i, fmi3Error, "%s does not belong to %s", call, i->head->kind == EXCHANGE ? "Model Exchange" : "Co-Simulation");
        return 0;
    }
    if (i->head->mode & modes)
        return 1;
    while (!(i->head->mode >> k & 1))
        k++;
    say(i, fmi3Error, "%s is not allowed in state %s", call, names[k]);
    return 0;
}
#define CHECK(kinds, modes) \
    Instance *const i = instance; \
    if (!allowed(i, __func__, kinds, modes)) \
        return fmi3Error
#define BOTH (EXCHANGE | SIMULATION)

static fmi3Status refused(Instance *i, const char *call, const char *why)
{
    return i ? say(i, fmi3Error, "%s: %s", call, why) : fmi3Error;
}

static int all_finite(const double *values, size_t n)
{
    size_t k;
    for (k = 0; k < n; k++)
        if (!(values[k] - values[k] == 0.0))
            return 0;
    return 1;
}

static int same(const double *a, const double *b, size_t n)
{
    size_t k;
    for (k = 0; k < n; k++)
        if (a[k] != b[k])
            return 0;
    return 1;
}

static void copy(double *to, const double *from, size_t n)
{
    if (n)
        memcpy(to, from, n * sizeof *to);
}

#include "runtime_fmi_instances.h"
#include "runtime_fmi_values.h"
#include "runtime_fmi_modes.h"
#include "runtime_fmi_exchange.h"
#include "runtime_fmi_simulation.h"
#include "runtime_fmi_states.h"
#include "runtime_fmi_derivatives.h"
#include "runtime_fmi_clocks.h"
