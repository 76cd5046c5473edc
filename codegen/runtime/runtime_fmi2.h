/* FMI 2.0 over the functions of FMI 3.0 beside it: the same instances, modes and values under the names and types of the older
   standard. What that lacks is left out: adjoint derivatives, events of Co-Simulation.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

#if defined _WIN32 || defined __CYGWIN__
#define EXPORT2 __declspec(dllexport)
#elif defined __GNUC__
#define EXPORT2 __attribute__((visibility("default")))
#else
#define EXPORT2
#endif

typedef void *fmi2Component, *fmi2ComponentEnvironment, *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer, fmi2Boolean;
typedef char fmi2Char, fmi2Byte;
typedef const fmi2Char *fmi2String;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef void (*fmi2CallbackLogger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
typedef struct {
    fmi2CallbackLogger logger;
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
    fmi2ComponentEnvironment environment;
} fmi2CallbackFunctions;
typedef struct {
    fmi2Boolean newDiscreteStatesNeeded, terminateSimulation, nominalsOfContinuousStatesChanged, valuesOfContinuousStatesChanged;
    fmi2Boolean nextEventTimeDefined;
    fmi2Real nextEventTime;
} fmi2EventInfo;

/* An instance, the experiment that is said before it begins, and how the last step ended. */
typedef struct {
    fmi3Instance instance;
    fmi2CallbackFunctions callbacks;
    char *name;
    int has_tolerance, has_stop, terminated;
    double tolerance, start, stop, reached;
} Component;

#define OF(component) ((component) ? ((Component *)(component))->instance : NULL)
#define STATUS(call) ((fmi2Status)(call))
#define NAMED2(...) EXPORT2 fmi2Status __VA_ARGS__; fmi2Status __VA_ARGS__

static void told(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message)
{
    const Component *const c = environment;
    if (c->callbacks.logger)
        c->callbacks.logger(c->callbacks.environment, c->name ? c->name : "", (fmi2Status)status, category, "%s", message);
}

EXPORT2 const char *fmi2GetTypesPlatform(void);
const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

EXPORT2 const char *fmi2GetVersion(void);
const char *fmi2GetVersion(void)
{
    return "2.0";
}

EXPORT2 void fmi2FreeInstance(fmi2Component component);
void fmi2FreeInstance(fmi2Component component)
{
    Component *const c = component;
    if (!c)
        return;
    fmi3FreeInstance(c->instance);
    free(c->name);
    free(c);
}

EXPORT2 fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources, const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging);
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources, const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    Component *const c = calloc(1, sizeof *c);
    if (!c)
        return NULL;
    if (callbacks)
        c->callbacks = *callbacks;
    if (name && (c->name = malloc(strlen(name) + 1)) != NULL)
        strcpy(c->name, name);
    c->instance = type == fmi2ModelExchange ?
        fmi3InstantiateModelExchange(name, guid, resources, visible != 0, logging != 0, c, told) :
        fmi3InstantiateCoSimulation(name, guid, resources, visible != 0, logging != 0, false, false, NULL, 0, c, told, NULL);
    if (c->instance && c->name)
        return c;
    fmi2FreeInstance(c);
    return NULL;
}

NAMED2(fmi2SetDebugLogging(fmi2Component component, fmi2Boolean on, size_t n, const fmi2String categories[]))
{
    return STATUS(fmi3SetDebugLogging(OF(component), on != 0, n, categories));
}

/* ---- modes */

NAMED2(fmi2SetupExperiment(fmi2Component component, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start, fmi2Boolean has_stop, fmi2Real stop))
{
    Component *const c = component;
    Instance *const i = OF(component);
    if (!allowed(i, __func__, BOTH, INSTANTIATED))
        return fmi2Error;
    if (!all_finite(&start, 1) || (has_stop && !(stop >= start)) || (has_tolerance && !(tolerance > 0.0)))
        return STATUS(refused(i, __func__, "the start has to be finite, the stop behind it, the tolerance above zero"));
    c->has_tolerance = has_tolerance;
    c->tolerance = tolerance;
    c->start = start;
    c->has_stop = has_stop;
    c->stop = stop;
    return fmi2OK;
}

NAMED2(fmi2EnterInitializationMode(fmi2Component component))
{
    Component *const c = component;
    if (!c)
        return fmi2Error;
    c->reached = c->start;
    return STATUS(fmi3EnterInitializationMode(c->instance, c->has_tolerance != 0, c->tolerance, c->start, c->has_stop != 0, c->stop));
}

NAMED2(fmi2ExitInitializationMode(fmi2Component component))
{
    return STATUS(fmi3ExitInitializationMode(OF(component)));
}

NAMED2(fmi2Terminate(fmi2Component component))
{
    return STATUS(fmi3Terminate(OF(component)));
}

NAMED2(fmi2Reset(fmi2Component component))
{
    Component *const c = component;
    if (!c)
        return fmi2Error;
    c->has_tolerance = c->has_stop = c->terminated = 0;
    c->start = c->stop = c->reached = 0.0;
    return STATUS(fmi3Reset(c->instance));
}

/* ---- values */

NAMED2(fmi2GetReal(fmi2Component component, const fmi2ValueReference references[], size_t n, fmi2Real values[]))
{
    return STATUS(fmi3GetFloat64(OF(component), references, n, values, n));
}

NAMED2(fmi2SetReal(fmi2Component component, const fmi2ValueReference references[], size_t n, const fmi2Real values[]))
{
    return STATUS(fmi3SetFloat64(OF(component), references, n, values, n));
}

/* Of the other types there is no variable. */
#define OTHER2(TYPE) \
    NAMED2(fmi2Get##TYPE(fmi2Component component, const fmi2ValueReference references[], size_t n, fmi2##TYPE values[])) \
    { \
        (void)references, (void)values; \
        return STATUS(none_of(OF(component), __func__, n)); \
    } \
    NAMED2(fmi2Set##TYPE(fmi2Component component, const fmi2ValueReference references[], size_t n, const fmi2##TYPE values[])) \
    { \
        (void)references, (void)values; \
        return STATUS(none_of(OF(component), __func__, n)); \
    }
OTHER2(Integer)
OTHER2(Boolean)
OTHER2(String)

NAMED2(fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *state))
{
    return STATUS(fmi3GetFMUState(OF(component), state));
}

NAMED2(fmi2SetFMUstate(fmi2Component component, fmi2FMUstate state))
{
    return STATUS(fmi3SetFMUState(OF(component), state));
}

NAMED2(fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *state))
{
    return STATUS(fmi3FreeFMUState(OF(component), state));
}

NAMED2(fmi2SerializedFMUstateSize(fmi2Component component, fmi2FMUstate state, size_t *size))
{
    return STATUS(fmi3SerializedFMUStateSize(OF(component), state, size));
}

NAMED2(fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate state, fmi2Byte bytes[], size_t size))
{
    return STATUS(fmi3SerializeFMUState(OF(component), state, (fmi3Byte *)bytes, size));
}

NAMED2(fmi2DeSerializeFMUstate(fmi2Component component, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state))
{
    return STATUS(fmi3DeserializeFMUState(OF(component), (const fmi3Byte *)bytes, size, state));
}

NAMED2(fmi2GetDirectionalDerivative(fmi2Component component, const fmi2ValueReference unknowns[], size_t n_unknowns, const fmi2ValueReference knowns[], size_t n_knowns, const fmi2Real seed[], fmi2Real sensitivity[]))
{
    return STATUS(fmi3GetDirectionalDerivative(OF(component), unknowns, n_unknowns, knowns, n_knowns, seed, n_knowns, sensitivity, n_unknowns));
}

/* ---- Model Exchange */

NAMED2(fmi2EnterEventMode(fmi2Component component))
{
    return STATUS(fmi3EnterEventMode(OF(component)));
}

NAMED2(fmi2NewDiscreteStates(fmi2Component component, fmi2EventInfo *info))
{
    fmi3Boolean again, terminate, nominals, states, defined;
    fmi3Status status;
    if (!info)
        return fmi2Error;
    info->nextEventTime = 0.0;
    status = fmi3UpdateDiscreteStates(OF(component), &again, &terminate, &nominals, &states, &defined, &info->nextEventTime);
    if (status == fmi3Error)
        return fmi2Error;
    info->newDiscreteStatesNeeded = again;
    info->terminateSimulation = terminate;
    info->nominalsOfContinuousStatesChanged = nominals;
    info->valuesOfContinuousStatesChanged = states;
    info->nextEventTimeDefined = defined;
    return STATUS(status);
}

NAMED2(fmi2EnterContinuousTimeMode(fmi2Component component))
{
    return STATUS(fmi3EnterContinuousTimeMode(OF(component)));
}

NAMED2(fmi2CompletedIntegratorStep(fmi2Component component, fmi2Boolean no_way_back, fmi2Boolean *event, fmi2Boolean *terminate))
{
    fmi3Boolean enter = false, end = false;
    const fmi3Status status = fmi3CompletedIntegratorStep(OF(component), no_way_back != 0, event ? &enter : NULL, terminate ? &end : NULL);
    if (status != fmi3Error) {
        *event = enter;
        *terminate = end;
    }
    return STATUS(status);
}

NAMED2(fmi2SetTime(fmi2Component component, fmi2Real time))
{
    return STATUS(fmi3SetTime(OF(component), time));
}

NAMED2(fmi2SetContinuousStates(fmi2Component component, const fmi2Real x[], size_t n))
{
    return STATUS(fmi3SetContinuousStates(OF(component), x, n));
}

NAMED2(fmi2GetDerivatives(fmi2Component component, fmi2Real rates_out[], size_t n))
{
    return STATUS(fmi3GetContinuousStateDerivatives(OF(component), rates_out, n));
}

NAMED2(fmi2GetEventIndicators(fmi2Component component, fmi2Real indicators[], size_t n))
{
    return STATUS(fmi3GetEventIndicators(OF(component), indicators, n));
}

NAMED2(fmi2GetContinuousStates(fmi2Component component, fmi2Real x[], size_t n))
{
    return STATUS(fmi3GetContinuousStates(OF(component), x, n));
}

NAMED2(fmi2GetNominalsOfContinuousStates(fmi2Component component, fmi2Real nominals[], size_t n))
{
    return STATUS(fmi3GetNominalsOfContinuousStates(OF(component), nominals, n));
}

/* ---- Co-Simulation */

NAMED2(fmi2SetRealInputDerivatives(fmi2Component component, const fmi2ValueReference references[], size_t n, const fmi2Integer orders[], const fmi2Real values[]))
{
    (void)references, (void)n, (void)orders, (void)values;
    return STATUS(refused(OF(component), __func__, "inputs are held between communication points"));
}

NAMED2(fmi2GetRealOutputDerivatives(fmi2Component component, const fmi2ValueReference references[], size_t n, const fmi2Integer orders[], fmi2Real values[]))
{
    (void)references, (void)n, (void)orders, (void)values;
    return STATUS(refused(OF(component), __func__, "this FMU has no derivatives of outputs"));
}

/* A step that an event ends is discarded from there on: fmi2Terminated and fmi2LastSuccessfulTime say so. */
NAMED2(fmi2DoStep(fmi2Component component, fmi2Real from, fmi2Real length, fmi2Boolean no_way_back))
{
    Component *const c = component;
    fmi3Boolean event, terminate = false, early;
    fmi3Status status;
    if (!c)
        return fmi2Error;
    status = fmi3DoStep(c->instance, from, length, no_way_back != 0, &event, &terminate, &early, &c->reached);
    c->terminated = terminate;
    return terminate ? fmi2Discard : STATUS(status);
}

NAMED2(fmi2CancelStep(fmi2Component component))
{
    return STATUS(refused(OF(component), __func__, "steps are not asynchronous"));
}

NAMED2(fmi2GetStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Status *value))
{
    (void)kind, (void)value;
    return OF(component) ? fmi2Discard : fmi2Error;
}

NAMED2(fmi2GetRealStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Real *value))
{
    if (!OF(component) || !value)
        return fmi2Error;
    if (kind != fmi2LastSuccessfulTime)
        return fmi2Discard;
    *value = ((Component *)component)->reached;
    return fmi2OK;
}

NAMED2(fmi2GetIntegerStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Integer *value))
{
    (void)kind, (void)value;
    return OF(component) ? fmi2Discard : fmi2Error;
}

NAMED2(fmi2GetBooleanStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Boolean *value))
{
    if (!OF(component) || !value)
        return fmi2Error;
    if (kind != fmi2Terminated)
        return fmi2Discard;
    *value = ((Component *)component)->terminated;
    return fmi2OK;
}

NAMED2(fmi2GetStringStatus(fmi2Component component, const fmi2StatusKind kind, fmi2String *value))
{
    (void)kind, (void)value;
    return OF(component) ? fmi2Discard : fmi2Error;
}
