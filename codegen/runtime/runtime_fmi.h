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
enum { STATE_VERSION = 1 };
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
    int logging;
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

/* ---- instances */

static size_t numbers(void)
{
    return 2 * model.states + model.inputs + model.parameters + model.events;
}

static size_t block_size(void)
{
    return sizeof(Head) + numbers() * sizeof(double) + model.simulation;
}

static size_t variables(void)
{
    size_t k, n = 0;
    for (k = 0; k < model.groups; k++)
        n += model.group[k].count;
    return n;
}

static void forget(Instance *i)
{
    memset(i->known, 0, (model.groups + 1) * sizeof *i->known);
}

static void begin(Instance *i, int kind)
{
    Head *const h = i->head;
    memset(h, 0, block_size());
    memcpy(h->token, model.token, strlen(model.token));
    h->version = STATE_VERSION;
    h->kind = kind;
    h->mode = INSTANTIATED;
    h->rtol = model.rtol;
    h->atol = model.atol;
    copy(i->x, model.x, model.states);
    copy(i->given, model.x, model.states);
    copy(i->p, model.p, model.parameters);
    forget(i);
}

static Instance *freed(Instance *i)
{
    if (i) {
        free(i->head);
        free(i->rates);
        free(i->known);
        free(i->name);
        free(i);
    }
    return NULL;
}

static Instance *instantiated(int kind, const char *name, const char *token, int logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    const size_t nx = model.states, wide = 2 * nx + model.inputs + model.parameters + variables();
    Instance empty = {0}, *i = &empty;
    double *d;
    empty.logging = 1; /* why there is no instance is said in any case */
    empty.environment = environment;
    empty.log = log;
    if (!name || !*name)
        return say(i, fmi3Error, "an instance needs a name"), NULL;
    if (!token || strcmp(token, model.token) != 0)
        return say(i, fmi3Error, "%s: the instantiation token is not that of this FMU", name), NULL;
    if (!model.fits())
        return say(i, fmi3Error, "%s: this binary was compiled for another processor; compile the FMU again from its sources", name), NULL;
    if (!(i = calloc(1, sizeof *i)))
        return NULL;
    *i = empty;
    i->head = calloc(1, block_size());
    i->rates = d = calloc(nx + variables() + 2 * wide + nx + 1, sizeof *d);
    i->known = calloc(model.groups + 1, sizeof *i->known);
    i->name = malloc(strlen(name) + 1);
    if (!i->head || !d || !i->known || !i->name)
        return freed(i);
    strcpy(i->name, name);
    i->values = d += nx;
    i->seed = d += variables();
    i->result = d += wide;
    i->reserve = d + wide;
    i->x = d = (double *)(i->head + 1);
    i->given = d += nx;
    i->u = d += nx;
    i->p = d += model.inputs;
    i->sign = d += model.parameters;
    i->simulation = d + model.events;
    i->logging = logging;
    begin(i, kind);
    return i;
}

const char *fmi3GetVersion(void)
{
    return "3.0";
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    (void)resources, (void)visible;
    return instantiated(EXCHANGE, name, token, logging, environment, log);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return, const fmi3ValueReference intermediate[], size_t n,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    const Instance here = {.logging = 1, .environment = environment, .log = log};
    (void)resources, (void)visible, (void)early_return, (void)intermediate, (void)update;
    if (event_mode)
        return say(&here, fmi3Error, "this FMU has no Event Mode in Co-Simulation"), NULL;
    if (n)
        return say(&here, fmi3Error, "this FMU has no intermediate variables"), NULL;
    return instantiated(SIMULATION, name, token, logging, environment, log);
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3ClockUpdateCallback update,
    fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock)
{
    const Instance here = {.logging = 1, .environment = environment, .log = log};
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)update, (void)lock, (void)unlock;
    return say(&here, fmi3Error, "this FMU has no Scheduled Execution"), NULL;
}

void fmi3FreeInstance(fmi3Instance instance)
{
    freed(instance);
}

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean on, size_t n, const fmi3String categories[])
{
    size_t k;
    CHECK(BOTH, ANY);
    for (k = 0; k < n; k++)
        if (!categories || !categories[k] || (strcmp(categories[k], "logStatusError") && strcmp(categories[k], "logStatusWarning")))
            return refused(i, __func__, "no such category");
    i->logging = on;
    return fmi3OK;
}

/* ---- values */

/* A status of a function as one of FMI: a solver may try a shorter step. */
static fmi3Status judged(const Instance *i, int status, const char *what)
{
    return status ? say(i, fmi3Discard, "%s at t = %.17g: %s", what, i->head->t, model.cause(status)) : fmi3OK;
}

/* The nearest consistent state to `given`. */
static int projected(Instance *i, const double *given, double *x)
{
    copy(x, given, model.states);
    if (!model.project)
        return 0;
    return model.project(i->head->t, given, i->u, i->p, x);
}

/* In Initialization Mode x follows from the start values. */
static fmi3Status settled(Instance *i)
{
    Head *const h = i->head;
    int status;
    if (h->mode != INITIALIZATION || h->settled)
        return fmi3OK;
    status = projected(i, i->given, i->reserve);
    if (status)
        return judged(i, status, "no consistent state near the start values");
    copy(i->x, i->reserve, model.states);
    h->settled = 1;
    return fmi3OK;
}

static fmi3Status rates(Instance *i)
{
    fmi3Status status = settled(i);
    if (status != fmi3OK || i->known[model.groups])
        return status;
    status = judged(i, model.dynamics(i->head->t, i->x, i->u, i->p, i->rates), "state derivative");
    i->known[model.groups] = status == fmi3OK;
    return status;
}

/* The values of group g. */
static fmi3Status group(Instance *i, size_t g, double **values)
{
    fmi3Status status = settled(i);
    size_t k;
    *values = i->values;
    for (k = 0; k < g; k++)
        *values += model.group[k].count;
    if (status != fmi3OK || i->known[g])
        return status;
    status = judged(i, model.group[g].values(i->head->t, i->x, i->u, i->p, *values), "variables");
    i->known[g] = status == fmi3OK;
    return status;
}

enum { TIME, STATE, RATE, INPUT, PARAMETER, VARIABLE, CONSTANT, NOTHING };

/* What a value reference stands for: its kind, and the place in that. */
static int kind_of(fmi3ValueReference reference, size_t *place)
{
    const size_t sizes[] = {1, model.states, model.states, model.inputs, model.parameters, variables(), model.constants};
    int kind = TIME;
    *place = reference;
    while (kind < NOTHING && *place >= sizes[kind])
        *place -= sizes[kind++];
    return kind;
}

static fmi3Status variable(Instance *i, size_t place, double *value)
{
    double *values;
    fmi3Status status;
    size_t g = 0;
    while (place >= model.group[g].count)
        place -= model.group[g++].count;
    if ((status = group(i, g, &values)) == fmi3OK)
        *value = values[place];
    return status;
}

static fmi3Status value_of(Instance *i, fmi3ValueReference reference, double *value)
{
    size_t k;
    const int kind = kind_of(reference, &k);
    fmi3Status status = kind == STATE ? settled(i) : kind == RATE ? rates(i) : fmi3OK;
    if (status != fmi3OK)
        return status;
    switch (kind) {
    case TIME: *value = i->head->t; return fmi3OK;
    case STATE: *value = i->x[k]; return fmi3OK;
    case RATE: *value = i->rates[k]; return fmi3OK;
    case INPUT: *value = i->u[k]; return fmi3OK;
    case PARAMETER: *value = i->p[k]; return fmi3OK;
    case CONSTANT: *value = model.constant[k]; return fmi3OK;
    case VARIABLE: return variable(i, k, value);
    default: return say(i, fmi3Error, "there is no variable with value reference %u", (unsigned)reference);
    }
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t n, fmi3Float64 values[], size_t count)
{
    fmi3Status status = fmi3OK;
    size_t k;
    CHECK(BOTH, READABLE);
    if (n != count || (n && (!references || !values)))
        return refused(i, __func__, "as many values as value references are needed");
    for (k = 0; k < n && status == fmi3OK; k++)
        status = value_of(i, references[k], values + k);
    return status;
}

/* In which modes a variable may be set. States of a model with constraints are guesses (initial = approx). */
static int settable(int kind)
{
    switch (kind) {
    case STATE: return model.project ? INSTANTIATED : INSTANTIATED | INITIALIZATION;
    case INPUT: return ANY & ~TERMINATED;
    case PARAMETER: return INSTANTIATED | INITIALIZATION | EVENT_MODE | STEP;
    default: return 0;
    }
}

static void take(Instance *i, int kind, size_t k, double value)
{
    Head *const h = i->head;
    if (kind == STATE)
        i->given[k] = i->x[k] = value;
    if (kind == INPUT) {
        h->new_u |= i->u[k] != value;
        i->u[k] = value;
    }
    if (kind == PARAMETER) {
        h->new_p |= i->p[k] != value;
        i->p[k] = value;
    }
    h->settled = 0;
}

/* All of it or nothing. */
fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t n, const fmi3Float64 values[], size_t count)
{
    size_t k, place;
    CHECK(BOTH, ANY & ~TERMINATED);
    if (n != count || (n && (!references || !values)))
        return refused(i, __func__, "as many values as value references are needed");
    for (k = 0; k < n; k++) {
        const int kind = kind_of(references[k], &place);
        if (!(settable(kind) & i->head->mode))
            return say(i, fmi3Error, "the variable with value reference %u cannot be set here", (unsigned)references[k]);
    }
    if (!all_finite(values, n))
        return refused(i, __func__, "a value is infinite or not a number");
    for (k = 0; k < n; k++) {
        const int kind = kind_of(references[k], &place);
        take(i, kind, place, values[k]);
    }
    forget(i);
    return fmi3OK;
}

static fmi3Status none_of(Instance *i, const char *call, size_t n)
{
    return !i ? fmi3Error : n ? refused(i, call, "there is no variable of this type") : fmi3OK;
}

#define DEFINED(TYPE) \
    fmi3Status fmi3Get##TYPE(REFERENCES, fmi3##TYPE values[], size_t count) \
    { \
        (void)references, (void)values; \
        return none_of(instance, __func__, n + count); \
    } \
    fmi3Status fmi3Set##TYPE(REFERENCES, const fmi3##TYPE values[], size_t count) \
    { \
        (void)references, (void)values; \
        return none_of(instance, __func__, n + count); \
    }
OTHER_TYPES(DEFINED)

fmi3Status fmi3GetBinary(REFERENCES, size_t sizes[], fmi3Binary values[], size_t count)
{
    (void)references, (void)sizes, (void)values;
    return none_of(instance, __func__, n + count);
}

fmi3Status fmi3SetBinary(REFERENCES, const size_t sizes[], const fmi3Binary values[], size_t count)
{
    (void)references, (void)sizes, (void)values;
    return none_of(instance, __func__, n + count);
}

fmi3Status fmi3GetClock(REFERENCES, fmi3Clock values[])
{
    (void)references, (void)values;
    return none_of(instance, __func__, n);
}

fmi3Status fmi3SetClock(REFERENCES, const fmi3Clock values[])
{
    (void)references, (void)values;
    return none_of(instance, __func__, n);
}

/* ---- modes */

/* On which side of zero each event is. */
static fmi3Status sides(Instance *i, double *sign)
{
    double *g;
    size_t k;
    fmi3Status status;
    if (!model.events)
        return fmi3OK;
    if ((status = group(i, model.groups - 1, &g)) != fmi3OK)
        return status;
    for (k = 0; k < model.events; k++)
        sign[k] = g[k] > 0.0 ? 1.0 : g[k] < 0.0 ? -1.0 : i->sign[k];
    return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean has_tolerance, fmi3Float64 tolerance, fmi3Float64 start,
    fmi3Boolean has_stop, fmi3Float64 stop)
{
    Head *h;
    CHECK(BOTH, INSTANTIATED);
    h = i->head;
    if (!all_finite(&start, 1) || (has_stop && !(stop >= start)))
        return refused(i, __func__, "times have to be finite, and the stop not before the start");
    if (has_tolerance && !(tolerance > 0.0 && all_finite(&tolerance, 1)))
        return refused(i, __func__, "the tolerance has to be above zero");
    if (has_tolerance) {
        h->rtol = tolerance;
        h->atol = tolerance * (model.atol / model.rtol);
    }
    h->t = start;
    h->has_stop = has_stop;
    h->stop = has_stop ? stop : 0.0;
    h->mode = INITIALIZATION;
    h->settled = 0;
    forget(i);
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    fmi3Status status;
    CHECK(BOTH, INITIALIZATION);
    status = settled(i);
    if (status == fmi3OK)
        status = sides(i, i->sign);
    if (status != fmi3OK)
        return fmi3Error;
    i->head->mode = i->head->kind == EXCHANGE ? EVENT_MODE : STEP;
    i->head->new_u = i->head->new_p = 0;
    return fmi3OK;
}

fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    CHECK(EXCHANGE, CONTINUOUS);
    i->head->mode = EVENT_MODE;
    return fmi3OK;
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance)
{
    CHECK(EXCHANGE, EVENT_MODE);
    i->head->mode = CONTINUOUS;
    return fmi3OK;
}

fmi3Status fmi3EnterStepMode(fmi3Instance instance)
{
    return refused(instance, __func__, "this FMU has no Event Mode in Co-Simulation");
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance)
{
    return refused(instance, __func__, "this FMU has no structural parameters");
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance)
{
    return refused(instance, __func__, "this FMU has no structural parameters");
}

fmi3Status fmi3Terminate(fmi3Instance instance)
{
    CHECK(BOTH, INITIALIZED);
    i->head->mode = TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance instance)
{
    CHECK(BOTH, ANY);
    begin(i, i->head->kind);
    return fmi3OK;
}

/* ---- Model Exchange */

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time)
{
    CHECK(EXCHANGE, EVENT_MODE | CONTINUOUS);
    if (!all_finite(&time, 1))
        return refused(i, __func__, "time has to be finite");
    if (time != i->head->t)
        forget(i);
    i->head->t = time;
    return fmi3OK;
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 states[], size_t n)
{
    CHECK(EXCHANGE, CONTINUOUS);
    if (n != model.states || (n && !states))
        return refused(i, __func__, "wrong number of states");
    if (!all_finite(states, n))
        return say(i, fmi3Discard, "%s: a state is infinite or not a number", __func__);
    if (!same(i->x, states, n))
        forget(i);
    copy(i->x, states, n);
    return fmi3OK;
}

fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 states[], size_t n)
{
    fmi3Status status;
    CHECK(EXCHANGE, READABLE);
    if (n != model.states || (n && !states))
        return refused(i, __func__, "wrong number of states");
    if ((status = settled(i)) == fmi3OK)
        copy(states, i->x, n);
    return status;
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 derivatives[], size_t n)
{
    fmi3Status status;
    CHECK(EXCHANGE, READABLE);
    if (n != model.states || (n && !derivatives))
        return refused(i, __func__, "wrong number of states");
    if ((status = rates(i)) == fmi3OK)
        copy(derivatives, i->rates, n);
    return status;
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[], size_t n)
{
    size_t k;
    CHECK(EXCHANGE, READABLE);
    if (n != model.states || (n && !nominals))
        return refused(i, __func__, "wrong number of states");
    for (k = 0; k < n; k++)
        nominals[k] = 1.0;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *n)
{
    CHECK(EXCHANGE, ANY);
    if (!n)
        return fmi3Error;
    *n = model.states;
    return fmi3OK;
}

fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 indicators[], size_t n)
{
    double *g;
    fmi3Status status = fmi3OK;
    CHECK(EXCHANGE, READABLE);
    if (n != model.events || (n && !indicators))
        return refused(i, __func__, "wrong number of event indicators");
    if (n && (status = group(i, model.groups - 1, &g)) == fmi3OK)
        copy(indicators, g, n);
    return status;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *n)
{
    CHECK(EXCHANGE, ANY);
    if (!n)
        return fmi3Error;
    *n = model.events;
    return fmi3OK;
}

/* Whether the state has drifted from its constraints. */
static int drifted(Instance *i)
{
    double worst = 0.0;
    size_t k;
    if (!model.project || !model.constraints || model.constraints(i->head->t, i->x, i->u, i->p, i->seed))
        return 0;
    for (k = 0; k < model.violations; k++)
        worst = fmax(worst, fabs(i->seed[k]));
    return worst > PROJECTED_FROM * i->head->rtol;
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean no_way_back, fmi3Boolean *event, fmi3Boolean *terminate)
{
    CHECK(EXCHANGE, CONTINUOUS);
    (void)no_way_back;
    if (!event || !terminate)
        return fmi3Error;
    *event = drifted(i);
    *terminate = false;
    return fmi3OK;
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance)
{
    return refused(instance, __func__, "this FMU has no discrete states");
}

/* Whether an event that is to end the motion happened since the last time. */
static fmi3Status ended(Instance *i, fmi3Boolean *terminate)
{
    double *const sign = i->seed;
    fmi3Status status = sides(i, sign);
    size_t k;
    for (k = 0; k < model.events && status == fmi3OK; k++) {
        const double change = sign[k] - i->sign[k];
        if (i->sign[k] != 0.0 && change * (model.direction[k] ? model.direction[k] : change) > 0.0 && model.stop[k])
            *terminate = true;
        i->sign[k] = sign[k];
    }
    return status;
}

/* The state back on its constraints, where it drifted or these are other ones. */
static void returned(Instance *i, fmi3Boolean *changed)
{
    if (!i->head->new_p && !drifted(i))
        return;
    if (projected(i, i->x, i->reserve)) {
        say(i, fmi3Warning, "the state is not on its constraints, and none near it is");
        return;
    }
    *changed = !same(i->x, i->reserve, model.states);
    copy(i->x, i->reserve, model.states);
    if (*changed)
        forget(i);
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *again, fmi3Boolean *terminate, fmi3Boolean *nominals_changed,
    fmi3Boolean *states_changed, fmi3Boolean *has_next_event, fmi3Float64 *next_event)
{
    CHECK(EXCHANGE, EVENT_MODE);
    if (!again || !terminate || !nominals_changed || !states_changed || !has_next_event || !next_event)
        return fmi3Error;
    *again = *terminate = *nominals_changed = *states_changed = *has_next_event = false;
    returned(i, states_changed);
    i->head->new_u = i->head->new_p = 0;
    return ended(i, terminate);
}

/* ---- Co-Simulation */

/* Makes a step from the state on, with what was set since the last one. */
static int stepped(Instance *i, double *time)
{
    Head *const h = i->head;
    int status;
    if (h->new_p) /* other constraints, perhaps, and another slope in any case */
        h->moving = 0;
    if (!h->moving) {
        if (h->new_p && (status = projected(i, i->x, i->reserve)) == 0)
            copy(i->x, i->reserve, model.states);
        model.start(i->simulation, h->t, i->x);
    }
    status = model.go(i->simulation, h->moving && h->new_u, i->u, i->p, h->rtol, h->atol, time, i->x);
    h->moving = 1;
    h->new_u = h->new_p = 0;
    h->t = *time;
    forget(i);
    return status;
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 from, fmi3Float64 length, fmi3Boolean no_way_back, fmi3Boolean *event,
    fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached)
{
    double time = from + length;
    Head *h;
    int status;
    CHECK(SIMULATION, STEP);
    h = i->head;
    (void)no_way_back;
    if (!event || !terminate || !early || !reached)
        return fmi3Error;
    *event = *terminate = *early = false;
    *reached = h->t;
    if (!all_finite(&time, 1) || !(length > 0.0) || !(time > h->t))
        return refused(i, __func__, "the communication step size has to be above zero");
    if (!(fabs(from - h->t) <= 1e-6 * length + 1e-12 * fabs(h->t)))
        return say(i, fmi3Error, "%s: the communication point is %.17g, not %.17g", __func__, h->t, from);
    if (h->has_stop && time > h->stop + 1e-6 * length)
        return refused(i, __func__, "the step ends after the stop time");
    status = stepped(i, &time);
    *reached = time;
    *terminate = status == STOPPED;
    *early = status == STOPPED;
    if (status == 0 || status == STOPPED)
        return fmi3OK;
    return say(i, fmi3Error, "stopped at t = %.17g: %s", time, model.cause(status));
}

fmi3Status fmi3GetOutputDerivatives(REFERENCES, const fmi3Int32 orders[], fmi3Float64 values[], size_t count)
{
    (void)references, (void)n, (void)orders, (void)values, (void)count;
    return refused(instance, __func__, "this FMU has no derivatives of outputs");
}

/* ---- FMU states */

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    CHECK(BOTH, ANY);
    if (!state)
        return fmi3Error;
    if (!*state && !(*state = malloc(block_size())))
        return refused(i, __func__, "no memory");
    memcpy(*state, i->head, block_size());
    return fmi3OK;
}

/* Whether a block is a state of this FMU and this kind of instance. */
static int fitting(const Instance *i, const Head *head)
{
    return head->version == STATE_VERSION && head->kind == i->head->kind && memcmp(head->token, i->head->token, sizeof head->token) == 0;
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state)
{
    CHECK(BOTH, ANY);
    if (!state || !fitting(i, state))
        return refused(i, __func__, "this is no state of such an instance");
    memcpy(i->head, state, block_size());
    forget(i);
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    CHECK(BOTH, ANY);
    if (state) {
        free(*state);
        *state = NULL;
    }
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state, size_t *size)
{
    CHECK(BOTH, ANY);
    if (!state || !size)
        return refused(i, __func__, "there is no state");
    *size = block_size();
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    CHECK(BOTH, ANY);
    if (!state || !bytes || size != block_size())
        return refused(i, __func__, "there is no state, or it has another size");
    memcpy(bytes, state, size);
    return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    Head head;
    CHECK(BOTH, ANY);
    if (!bytes || !state || size != block_size())
        return refused(i, __func__, "this is no state of this FMU");
    memcpy(&head, bytes, sizeof head);
    if (!fitting(i, &head))
        return refused(i, __func__, "this is no state of such an instance");
    if (!*state && !(*state = malloc(size)))
        return refused(i, __func__, "no memory");
    memcpy(*state, bytes, size);
    return fmi3OK;
}

/* ---- derivatives */

/* A known as its column among x, u, p; -1 for any other variable. */
static long column(fmi3ValueReference reference)
{
    size_t k;
    switch (kind_of(reference, &k)) {
    case STATE: return (long)k;
    case INPUT: return (long)(model.states + k);
    case PARAMETER: return model.jacobian_p && !model.outputs ? (long)(model.states + model.inputs + k) : -1;
    default: return -1;
    }
}

/* An unknown as its row among x', x, the model's outputs; -1 for any other variable. */
static long row(fmi3ValueReference reference)
{
    size_t k;
    switch (kind_of(reference, &k)) {
    case RATE: return (long)k;
    case STATE: return (long)(model.states + k);
    case VARIABLE: return k < model.outputs ? (long)(2 * model.states + k) : -1;
    default: return -1;
    }
}

/* to += the matrix, rows x columns, times `by`; transposed where that is asked for. */
static void add_product(const double *matrix, size_t rows, size_t columns, int transposed, const double *by, double *to)
{
    size_t r, c;
    for (r = 0; r < rows; r++)
        for (c = 0; c < columns; c++)
            to[transposed ? c : r] += matrix[r * columns + c] * by[transposed ? r : c];
}

static int add_matrix(Instance *i, Result matrix, size_t rows, size_t columns, int transposed, const double *by, double *to)
{
    double *values;
    int status;
    if (!matrix || !rows || !columns)
        return 0;
    if (!(values = malloc(rows * columns * sizeof *values)))
        return -1;
    status = matrix(i->head->t, i->x, i->u, i->p, values);
    if (!status)
        add_product(values, rows, columns, transposed, by, to);
    free(values);
    return status;
}

/* x' along (dx, du), or products of x' with y from the left: by the function that has them, else by Jacobians. */
static int of_rates(Instance *i, int transposed, const double *by, double *to)
{
    const size_t nx = model.states, nu = model.inputs, given = transposed ? nx : nx + nu, made = transposed ? nx + nu : nx;
    const Result whole = transposed ? model.adjoint : model.forward;
    double *taken;
    int status;
    if (!whole) {
        if ((status = add_matrix(i, model.jacobian, nx, nx, transposed, by, to)) != 0)
            return status;
        return add_matrix(i, model.jacobian_u, nx, nu, transposed, by + (transposed ? 0 : nx), to + (transposed ? nx : 0));
    }
    if (!(taken = malloc((nx + given + made + 1) * sizeof *taken)))
        return -1;
    copy(taken, i->x, nx);
    copy(taken + nx, by, given);
    status = whole(i->head->t, taken, i->u, i->p, taken + nx + given);
    if (!status)
        copy(to, taken + nx + given, made);
    free(taken);
    return status;
}

/* All results from all seeds: over (x, u, p) and (x', x, outputs), or the other way. */
static int derived(Instance *i, int transposed)
{
    const size_t nx = model.states, np = model.parameters, nu = model.inputs;
    double *const columns = transposed ? i->result : i->seed, *const rows = transposed ? i->seed : i->result;
    const double *const by = i->seed;
    int status = of_rates(i, transposed, by, i->result);
    size_t k;
    if (status)
        return status;
    for (k = 0; k < nx; k++)
        *(transposed ? columns + k : rows + nx + k) += transposed ? rows[nx + k] : columns[k];
    status = add_matrix(i, model.outputs_jacobian, model.outputs, nx, transposed, transposed ? rows + 2 * nx : columns, transposed ? columns : rows + 2 * nx);
    if (status || model.outputs)
        return status;
    return add_matrix(i, model.jacobian_p, nx, np, transposed, transposed ? rows : columns + nx + nu, transposed ? columns + nx + nu : rows);
}

/* From seeds of some variables to sensitivities of others. */
static fmi3Status derivative(Instance *i, const char *call, int transposed, const fmi3ValueReference from[], size_t n_from,
    const fmi3ValueReference to[], size_t n_to, const double *seed, double *sensitivity)
{
    const size_t wide = 2 * model.states + model.inputs + model.parameters + variables();
    fmi3Status status = settled(i);
    size_t k;
    if (!(model.forward && model.adjoint) && !model.jacobian)
        return refused(i, call, "this FMU was made without derivatives");
    if (i->head->mode == INITIALIZATION && model.project)
        return refused(i, call, "the start values of this model are guesses: there are no derivatives by them");
    if (status != fmi3OK)
        return status;
    for (k = 0; k < n_from + n_to; k++) {
        const int is_from = k < n_from;
        const fmi3ValueReference reference = is_from ? from[k] : to[k - n_from];
        if ((is_from != transposed ? column(reference) : row(reference)) < 0)
            return say(i, fmi3Error, "%s: no derivatives of or by the variable with value reference %u", call, (unsigned)reference);
    }
    if (!all_finite(seed, n_from))
        return refused(i, call, "a seed is infinite or not a number");
    memset(i->seed, 0, 2 * wide * sizeof *i->seed);
    for (k = 0; k < n_from; k++)
        i->seed[transposed ? row(from[k]) : column(from[k])] += seed[k];
    status = judged(i, derived(i, transposed), "derivatives");
    for (k = 0; k < n_to && status == fmi3OK; k++)
        sensitivity[k] = i->result[transposed ? column(to[k]) : row(to[k])];
    return status;
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t n_unknowns,
    const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[], size_t n_seed, fmi3Float64 sensitivity[],
    size_t n_sensitivity)
{
    CHECK(BOTH, INITIALIZATION | INITIALIZED);
    if (n_seed != n_knowns || n_sensitivity != n_unknowns)
        return refused(i, __func__, "a seed for every known and a sensitivity for every unknown are needed");
    return derivative(i, __func__, 0, knowns, n_knowns, unknowns, n_unknowns, seed, sensitivity);
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t n_unknowns,
    const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[], size_t n_seed, fmi3Float64 sensitivity[],
    size_t n_sensitivity)
{
    CHECK(BOTH, INITIALIZATION | INITIALIZED);
    if (n_seed != n_unknowns || n_sensitivity != n_knowns)
        return refused(i, __func__, "a seed for every unknown and a sensitivity for every known are needed");
    return derivative(i, __func__, 1, unknowns, n_unknowns, knowns, n_knowns, seed, sensitivity);
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference reference, size_t *n)
{
    (void)reference, (void)n;
    return refused(instance, __func__, "dependencies do not change");
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent, size_t elements[],
    fmi3ValueReference independents[], size_t independent_elements[], fmi3DependencyKind kinds[], size_t n)
{
    (void)dependent, (void)elements, (void)independents, (void)independent_elements, (void)kinds, (void)n;
    return refused(instance, __func__, "dependencies do not change");
}

/* ---- clocks, of which there are none */

fmi3Status fmi3GetIntervalDecimal(REFERENCES, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
{
    (void)references, (void)n, (void)intervals, (void)qualifiers;
    return refused(instance, __func__, "this FMU has no clocks");
}

fmi3Status fmi3GetIntervalFraction(REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
{
    (void)references, (void)n, (void)counters, (void)resolutions, (void)qualifiers;
    return refused(instance, __func__, "this FMU has no clocks");
}

fmi3Status fmi3GetShiftDecimal(REFERENCES, fmi3Float64 shifts[])
{
    (void)references, (void)n, (void)shifts;
    return refused(instance, __func__, "this FMU has no clocks");
}

fmi3Status fmi3GetShiftFraction(REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
{
    (void)references, (void)n, (void)counters, (void)resolutions;
    return refused(instance, __func__, "this FMU has no clocks");
}

fmi3Status fmi3SetIntervalDecimal(REFERENCES, const fmi3Float64 intervals[])
{
    (void)references, (void)n, (void)intervals;
    return refused(instance, __func__, "this FMU has no clocks");
}

fmi3Status fmi3SetIntervalFraction(REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
{
    (void)references, (void)n, (void)counters, (void)resolutions;
    return refused(instance, __func__, "this FMU has no clocks");
}

fmi3Status fmi3SetShiftDecimal(REFERENCES, const fmi3Float64 shifts[])
{
    (void)references, (void)n, (void)shifts;
    return refused(instance, __func__, "this FMU has no clocks");
}

fmi3Status fmi3SetShiftFraction(REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
{
    (void)references, (void)n, (void)counters, (void)resolutions;
    return refused(instance, __func__, "this FMU has no clocks");
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clock, fmi3Float64 time)
{
    (void)clock, (void)time;
    return refused(instance, __func__, "this FMU has no clocks");
}
