/* FMI 3.0 for co-simulation.
 *
 * Copyright (c) the mofit developers. MIT licence, see documentation/licenses.
 */
#include <stdlib.h>

#include "cosimulation.h"
#include "fmi3Functions.h"

typedef struct {
  Memory memory;
  fmi3InstanceEnvironment environment;
  fmi3LogMessageCallback log;
} Instance;

#define M (&((Instance*)instance)->memory)

/* Errors are told whether or not debug logging is on. */
static fmi3Status told(fmi3Instance instance, const char* fault) {
  const Instance* own = (const Instance*)instance;
  if (!fault) return fmi3OK;
  if (own->log) own->log(own->environment, fmi3Error, "logStatusError", fault);
  return fmi3Error;
}

static fmi3Status lacking(fmi3Instance instance) {
  return told(instance, "this FMU has no such function or variables");
}

const char* fmi3GetVersion(void) { return fmi3Version; }

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early_return,
                                         const fmi3ValueReference intermediate[], size_t intermediates,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
  Instance* instance;
  (void)name, (void)resources, (void)visible, (void)logging, (void)early_return, (void)intermediate, (void)update;
  if (!token || strcmp(token, MODEL_TOKEN) || events || intermediates) {
    if (log)
      log(environment, fmi3Error, "logStatusError",
          "events and intermediate variables are not supported, or the token is that of another FMU");
    return NULL;
  }
  instance = (Instance*)calloc(1, sizeof *instance);
  if (!instance) return NULL;
  instance->environment = environment;
  instance->log = log;
  reset(&instance->memory);
  return instance;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log) {
  (void)name, (void)token, (void)resources, (void)visible, (void)logging;
  if (log) log(environment, fmi3Error, "logStatusError", "this FMU is one for co-simulation");
  return NULL;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock) {
  (void)update, (void)lock, (void)unlock;
  return fmi3InstantiateModelExchange(name, token, resources, visible, logging, environment, log);
}

void fmi3FreeInstance(fmi3Instance instance) { free(instance); }

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean on, size_t count, const fmi3String categories[]) {
  (void)instance, (void)on, (void)count, (void)categories;
  return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
                                       fmi3Float64 start_time, fmi3Boolean has_stop_time, fmi3Float64 stop_time) {
  (void)has_stop_time, (void)stop_time;
  if (M->mode != INSTANTIATED) return told(instance, "the FMU is initialized already");
  begin_initialisation(M, has_tolerance, tolerance, start_time);
  M->mode = INITIALISING;
  return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) { return told(instance, end_initialisation(M)); }

fmi3Status fmi3Terminate(fmi3Instance instance) {
  M->mode = TERMINATED;
  return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance instance) {
  reset(M);
  return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                          fmi3Float64 values[], size_t length) {
  if (length != count) return told(instance, "every variable is a scalar");
  return told(instance, get_values(M, references, count, values));
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                          const fmi3Float64 values[], size_t length) {
  size_t k;
  if (length != count) return told(instance, "every variable is a scalar");
  for (k = 0; k < count; k++) {
    const char* fault = set_value(M, references[k], values[k]);
    if (fault) return told(instance, fault);
  }
  return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 time, fmi3Float64 length, fmi3Boolean no_return,
                      fmi3Boolean* event, fmi3Boolean* terminate, fmi3Boolean* early, fmi3Float64* last_time) {
  const char* fault = do_step(M, time, length);
  (void)no_return;
  *event = *terminate = *early = fmi3False;
  *last_time = M->time;
  return told(instance, fault);
}

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState* state) {
  if (!*state) *state = malloc(sizeof(Memory));
  if (!*state) return fmi3Error;
  memcpy(*state, M, sizeof(Memory));
  return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state) {
  memcpy(M, state, sizeof(Memory));
  return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState* state) {
  (void)instance;
  free(*state);
  *state = NULL;
  return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state, size_t* size) {
  (void)instance, (void)state;
  *size = sizeof(Memory);
  return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
  if (size < sizeof(Memory)) return told(instance, "too few bytes for the state");
  memcpy(bytes, state, sizeof(Memory));
  return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState* state) {
  if (size != sizeof(Memory)) return told(instance, "these bytes are no state of this FMU");
  if (!*state) *state = malloc(sizeof(Memory));
  if (!*state) return fmi3Error;
  memcpy(*state, bytes, sizeof(Memory));
  return fmi3OK;
}

/* What an FMU of 64-bit variables without events and clocks does not have. No value asked for is none lacking. */

#define NO_VARIABLES(Type)                                                                                        \
  fmi3Status fmi3Get##Type(fmi3Instance instance, const fmi3ValueReference references[], size_t count,            \
                           fmi3##Type values[], size_t length) {                                                  \
    (void)references, (void)values, (void)length;                                                                 \
    return count ? lacking(instance) : fmi3OK;                                                                    \
  }                                                                                                               \
  fmi3Status fmi3Set##Type(fmi3Instance instance, const fmi3ValueReference references[], size_t count,            \
                           const fmi3##Type values[], size_t length) {                                            \
    (void)references, (void)values, (void)length;                                                                 \
    return count ? lacking(instance) : fmi3OK;                                                                    \
  }

NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(Int32)
NO_VARIABLES(UInt32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)

#define LACKING(Name, Arguments) \
  fmi3Status fmi3##Name Arguments { return lacking(instance); }

LACKING(EnterEventMode, (fmi3Instance instance))
LACKING(GetBinary, (fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
        size_t valueSizes[], fmi3Binary values[], size_t nValues))
LACKING(GetClock, (fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
        fmi3Clock values[]))
LACKING(SetBinary, (fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
        const size_t valueSizes[], const fmi3Binary values[], size_t nValues))
LACKING(SetClock, (fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
        const fmi3Clock values[]))
LACKING(GetNumberOfVariableDependencies, (fmi3Instance instance, fmi3ValueReference valueReference,
        size_t* nDependencies))
LACKING(GetVariableDependencies, (fmi3Instance instance, fmi3ValueReference dependent,
        size_t elementIndicesOfDependent[], fmi3ValueReference independents[], size_t elementIndicesOfIndependents[],
        fmi3DependencyKind dependencyKinds[], size_t nDependencies))
LACKING(GetDirectionalDerivative, (fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
        const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
        fmi3Float64 sensitivity[], size_t nSensitivity))
LACKING(GetAdjointDerivative, (fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
        const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
        fmi3Float64 sensitivity[], size_t nSensitivity))
LACKING(EnterConfigurationMode, (fmi3Instance instance))
LACKING(ExitConfigurationMode, (fmi3Instance instance))
LACKING(GetIntervalDecimal, (fmi3Instance instance, const fmi3ValueReference valueReferences[],
        size_t nValueReferences, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]))
LACKING(GetIntervalFraction, (fmi3Instance instance, const fmi3ValueReference valueReferences[],
        size_t nValueReferences, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]))
LACKING(GetShiftDecimal, (fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
        fmi3Float64 shifts[]))
LACKING(GetShiftFraction, (fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
        fmi3UInt64 counters[], fmi3UInt64 resolutions[]))
LACKING(SetIntervalDecimal, (fmi3Instance instance, const fmi3ValueReference valueReferences[],
        size_t nValueReferences, const fmi3Float64 intervals[]))
LACKING(SetIntervalFraction, (fmi3Instance instance, const fmi3ValueReference valueReferences[],
        size_t nValueReferences, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]))
LACKING(SetShiftDecimal, (fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
        const fmi3Float64 shifts[]))
LACKING(SetShiftFraction, (fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
        const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]))
LACKING(EvaluateDiscreteStates, (fmi3Instance instance))
LACKING(UpdateDiscreteStates, (fmi3Instance instance, fmi3Boolean* discreteStatesNeedUpdate,
        fmi3Boolean* terminateSimulation, fmi3Boolean* nominalsOfContinuousStatesChanged,
        fmi3Boolean* valuesOfContinuousStatesChanged, fmi3Boolean* nextEventTimeDefined, fmi3Float64* nextEventTime))
LACKING(EnterContinuousTimeMode, (fmi3Instance instance))
LACKING(CompletedIntegratorStep, (fmi3Instance instance, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
        fmi3Boolean* enterEventMode, fmi3Boolean* terminateSimulation))
LACKING(SetTime, (fmi3Instance instance, fmi3Float64 time))
LACKING(SetContinuousStates, (fmi3Instance instance, const fmi3Float64 continuousStates[], size_t nContinuousStates))
LACKING(GetContinuousStateDerivatives, (fmi3Instance instance, fmi3Float64 derivatives[], size_t nContinuousStates))
LACKING(GetEventIndicators, (fmi3Instance instance, fmi3Float64 eventIndicators[], size_t nEventIndicators))
LACKING(GetContinuousStates, (fmi3Instance instance, fmi3Float64 continuousStates[], size_t nContinuousStates))
LACKING(GetNominalsOfContinuousStates, (fmi3Instance instance, fmi3Float64 nominals[], size_t nContinuousStates))
LACKING(GetNumberOfEventIndicators, (fmi3Instance instance, size_t* nEventIndicators))
LACKING(GetNumberOfContinuousStates, (fmi3Instance instance, size_t* nContinuousStates))
LACKING(EnterStepMode, (fmi3Instance instance))
LACKING(GetOutputDerivatives, (fmi3Instance instance, const fmi3ValueReference valueReferences[],
        size_t nValueReferences, const fmi3Int32 orders[], fmi3Float64 values[], size_t nValues))
LACKING(ActivateModelPartition, (fmi3Instance instance, fmi3ValueReference clockReference, fmi3Float64 activationTime))
