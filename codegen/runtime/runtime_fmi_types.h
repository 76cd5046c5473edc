/* The C interface of FMI 3.0, as its standard (fmi-standard.org) defines it: types, and the functions that an importer calls.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#if defined EXPORT
/* as the file says that includes this one */
#elif defined _WIN32 || defined __CYGWIN__
#define EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

typedef void *fmi3Instance, *fmi3InstanceEnvironment, *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef float fmi3Float32;
typedef double fmi3Float64;
typedef int8_t fmi3Int8;
typedef uint8_t fmi3UInt8, fmi3Byte;
typedef int16_t fmi3Int16;
typedef uint16_t fmi3UInt16;
typedef int32_t fmi3Int32;
typedef uint32_t fmi3UInt32;
typedef int64_t fmi3Int64;
typedef uint64_t fmi3UInt64;
typedef bool fmi3Boolean, fmi3Clock;
typedef const char *fmi3String;
typedef const fmi3Byte *fmi3Binary;

typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef enum { fmi3Independent, fmi3Constant, fmi3Fixed, fmi3Tunable, fmi3Discrete, fmi3Dependent } fmi3DependencyKind;
typedef enum { fmi3IntervalNotYetKnown, fmi3IntervalUnchanged, fmi3IntervalChanged } fmi3IntervalQualifier;

typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message);
typedef void (*fmi3ClockUpdateCallback)(fmi3InstanceEnvironment environment);
typedef void (*fmi3IntermediateUpdateCallback)(fmi3InstanceEnvironment environment, fmi3Float64 time, fmi3Boolean set_requested,
    fmi3Boolean get_allowed, fmi3Boolean step_finished, fmi3Boolean can_return_early, fmi3Boolean *early_return_requested,
    fmi3Float64 *early_return_time);
typedef void (*fmi3LockPreemptionCallback)(void);
typedef void (*fmi3UnlockPreemptionCallback)(void);

/* Value references and how many there are. */
#define REFERENCES fmi3Instance instance, const fmi3ValueReference references[], size_t n

EXPORT const char *fmi3GetVersion(void);
EXPORT fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean on, size_t n, const fmi3String categories[]);
EXPORT fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log);
EXPORT fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return, const fmi3ValueReference intermediate[], size_t n,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update);
EXPORT fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3ClockUpdateCallback update,
    fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock);
EXPORT void fmi3FreeInstance(fmi3Instance instance);

EXPORT fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean has_tolerance, fmi3Float64 tolerance, fmi3Float64 start,
    fmi3Boolean has_stop, fmi3Float64 stop);
EXPORT fmi3Status fmi3ExitInitializationMode(fmi3Instance instance);
EXPORT fmi3Status fmi3EnterEventMode(fmi3Instance instance);
EXPORT fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance);
EXPORT fmi3Status fmi3EnterStepMode(fmi3Instance instance);
EXPORT fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance);
EXPORT fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance);
EXPORT fmi3Status fmi3Terminate(fmi3Instance instance);
EXPORT fmi3Status fmi3Reset(fmi3Instance instance);

EXPORT fmi3Status fmi3GetFloat64(REFERENCES, fmi3Float64 values[], size_t count);
EXPORT fmi3Status fmi3SetFloat64(REFERENCES, const fmi3Float64 values[], size_t count);
/* Of the other types there is no variable. */
#define OTHER_TYPES(X) X(Float32) X(Int8) X(UInt8) X(Int16) X(UInt16) X(Int32) X(UInt32) X(Int64) X(UInt64) X(Boolean) X(String)
#define DECLARED(TYPE) \
    EXPORT fmi3Status fmi3Get##TYPE(REFERENCES, fmi3##TYPE values[], size_t count); \
    EXPORT fmi3Status fmi3Set##TYPE(REFERENCES, const fmi3##TYPE values[], size_t count);
OTHER_TYPES(DECLARED)
EXPORT fmi3Status fmi3GetBinary(REFERENCES, size_t sizes[], fmi3Binary values[], size_t count);
EXPORT fmi3Status fmi3SetBinary(REFERENCES, const size_t sizes[], const fmi3Binary values[], size_t count);
EXPORT fmi3Status fmi3GetClock(REFERENCES, fmi3Clock values[]);
EXPORT fmi3Status fmi3SetClock(REFERENCES, const fmi3Clock values[]);

EXPORT fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference reference, size_t *n);
EXPORT fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent, size_t elements[],
    fmi3ValueReference independents[], size_t independent_elements[], fmi3DependencyKind kinds[], size_t n);
EXPORT fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state);
EXPORT fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state);
EXPORT fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state);
EXPORT fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state, size_t *size);
EXPORT fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size);
EXPORT fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState *state);
EXPORT fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t n_unknowns,
    const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[], size_t n_seed, fmi3Float64 sensitivity[],
    size_t n_sensitivity);
EXPORT fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t n_unknowns,
    const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[], size_t n_seed, fmi3Float64 sensitivity[],
    size_t n_sensitivity);

EXPORT fmi3Status fmi3GetIntervalDecimal(REFERENCES, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]);
EXPORT fmi3Status fmi3GetIntervalFraction(REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]);
EXPORT fmi3Status fmi3GetShiftDecimal(REFERENCES, fmi3Float64 shifts[]);
EXPORT fmi3Status fmi3GetShiftFraction(REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[]);
EXPORT fmi3Status fmi3SetIntervalDecimal(REFERENCES, const fmi3Float64 intervals[]);
EXPORT fmi3Status fmi3SetIntervalFraction(REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]);
EXPORT fmi3Status fmi3SetShiftDecimal(REFERENCES, const fmi3Float64 shifts[]);
EXPORT fmi3Status fmi3SetShiftFraction(REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]);
EXPORT fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clock, fmi3Float64 time);

EXPORT fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance);
EXPORT fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *again, fmi3Boolean *terminate, fmi3Boolean *nominals_changed,
    fmi3Boolean *states_changed, fmi3Boolean *has_next_event, fmi3Float64 *next_event);
EXPORT fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean no_way_back, fmi3Boolean *event, fmi3Boolean *terminate);
EXPORT fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time);
EXPORT fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 states[], size_t n);
EXPORT fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 states[], size_t n);
EXPORT fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 derivatives[], size_t n);
EXPORT fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[], size_t n);
EXPORT fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *n);
EXPORT fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 indicators[], size_t n);
EXPORT fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *n);
EXPORT fmi3Status fmi3GetOutputDerivatives(REFERENCES, const fmi3Int32 orders[], fmi3Float64 values[], size_t count);
EXPORT fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 from, fmi3Float64 length, fmi3Boolean no_way_back, fmi3Boolean *event,
    fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached);

/* What an FMU knows of its model. */
typedef int (*Result)(double t, const double *x, const double *u, const double *p, double *out);

/* Variables that a function gives. */
typedef struct {
    Result values;
    size_t count;
} Group;

/* Value references count: time, x, x', u, p, then the variables of each group, then constants. NULL is what the model has no use for. */
typedef struct {
    const char *token;
    size_t states, inputs, parameters, groups, constants;
    const double *x, *p, *constant; /* start values, and those of constants */
    const double *nominal; /* sizes of the states */
    const Group *group;
    size_t outputs; /* variables of the first group where that is `outputs`, else 0 */
    size_t events; /* variables of the last group where that is `events`, else 0 */
    const signed char *direction, *stop; /* of each event */
    Result dynamics, project, constraints;
    size_t violations; /* results of constraints */
    Result forward, adjoint; /* (x, dx, du) to x' along them; (x, y) to products with y from the left */
    Result jacobian, jacobian_u, jacobian_p, outputs_jacobian; /* row by row */
    double rtol, atol; /* when none is given */
    size_t simulation; /* bytes of a motion on its way */
    void (*start)(void *simulation, double t, const double *x);
    /* Goes on to *time, or less far. Writes x and the time that was reached; `changed` says that u is another than before. */
    int (*go)(void *simulation, int changed, const double *u, const double *p, double rtol, double atol, double *time, double *x);
    const char *(*cause)(int status);
    int (*fits)(void); /* this processor */
} Model;

enum { STOPPED = 11 }; /* an event that is to end the motion did */
