/* Instances of an FMU: their memory, how they are made and freed. A part of runtime_fmi.h.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

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
    Instance *i;
    (void)resources, (void)visible, (void)intermediate, (void)update;
    if (event_mode)
        return say(&here, fmi3Error, "this FMU has no Event Mode in Co-Simulation"), NULL;
    if (n)
        return say(&here, fmi3Error, "this FMU has no intermediate variables"), NULL;
    if ((i = instantiated(SIMULATION, name, token, logging, environment, log)))
        i->may_return_early = early_return;
    return i;
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
