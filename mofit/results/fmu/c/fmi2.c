/* FMI 2.0 for co-simulation.
 *
 * Copyright (c) the mofit developers. MIT licence, see documentation/licenses.
 */
#include <stdlib.h>

#include "cosimulation.h"
#include "fmi2Functions.h"

typedef struct {
  Memory memory;
  const fmi2CallbackFunctions* callbacks;
  char* name;
  int logging;
} Instance;

#define M (&((Instance*)component)->memory)

/* Errors are told whether or not debug logging is on. */
static fmi2Status told(Instance* instance, const char* fault) {
  if (!fault) return fmi2OK;
  if (instance->callbacks && instance->callbacks->logger)
    instance->callbacks->logger(instance->callbacks->componentEnvironment, instance->name, fmi2Error, "logStatusError",
                                "%s", fault);
  return fmi2Error;
}

static fmi2Status lacking(fmi2Component component) {
  return told((Instance*)component, "this FMU has no such function or variables");
}

const char* fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char* fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions* callbacks, fmi2Boolean visible, fmi2Boolean logging) {
  Instance* instance;
  (void)resources, (void)visible;
  if (type != fmi2CoSimulation || !name || !guid || strcmp(guid, MODEL_TOKEN)) {
    if (callbacks && callbacks->logger)
      callbacks->logger(callbacks->componentEnvironment, name ? name : "", fmi2Error, "logStatusError",
                        "not for co-simulation, or the GUID is that of another FMU");
    return NULL;
  }
  instance = (Instance*)calloc(1, sizeof *instance);
  if (!instance) return NULL;
  instance->name = (char*)malloc(strlen(name) + 1);
  if (!instance->name) {
    free(instance);
    return NULL;
  }
  strcpy(instance->name, name);
  instance->callbacks = callbacks;
  instance->logging = logging;
  reset(&instance->memory);
  return instance;
}

void fmi2FreeInstance(fmi2Component component) {
  if (!component) return;
  free(((Instance*)component)->name);
  free(component);
}

fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean on, size_t count, const fmi2String categories[]) {
  (void)count, (void)categories;
  ((Instance*)component)->logging = on;
  return fmi2OK;
}

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean has_tolerance, fmi2Real tolerance,
                               fmi2Real start_time, fmi2Boolean has_stop_time, fmi2Real stop_time) {
  (void)has_stop_time, (void)stop_time;
  begin_initialisation(M, has_tolerance, tolerance, start_time);
  return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component) {
  if (M->mode != INSTANTIATED) return told((Instance*)component, "the FMU is initialized already");
  M->mode = INITIALISING;
  return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component) {
  return told((Instance*)component, end_initialisation(M));
}

fmi2Status fmi2Terminate(fmi2Component component) {
  M->mode = TERMINATED;
  return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component component) {
  reset(M);
  return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference references[], size_t count,
                       fmi2Real values[]) {
  return told((Instance*)component, get_values(M, references, count, values));
}

fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference references[], size_t count,
                       const fmi2Real values[]) {
  size_t k;
  for (k = 0; k < count; k++) {
    const char* fault = set_value(M, references[k], values[k]);
    if (fault) return told((Instance*)component, fault);
  }
  return fmi2OK;
}

/* A derivative of an input is the input variable of that order. */
static const char* set_derivative(Memory* m, unsigned reference, int order, double value) {
  const int own = (int)reference - FIRST_INPUT, at = own + order;
  if (own < 0 || own >= CHANNELS * ORDERS || order < 1) return "this variable has no input derivative";
  if (check_finite(value)) return check_finite(value);
  if (at / ORDERS != own / ORDERS) return NULL; /* of an order that is not used */
  m->set[at] = value;
  m->given[at] = 1;
  begin_curve(m);
  return NULL;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component component, const fmi2ValueReference references[], size_t count,
                                       const fmi2Integer orders[], const fmi2Real values[]) {
  size_t k;
  for (k = 0; k < count; k++) {
    const char* fault = set_derivative(M, references[k], orders[k], values[k]);
    if (fault) return told((Instance*)component, fault);
  }
  return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real time, fmi2Real length, fmi2Boolean no_return) {
  (void)no_return;
  return told((Instance*)component, do_step(M, time, length));
}

fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate* state) {
  if (!*state) *state = malloc(sizeof(Memory));
  if (!*state) return fmi2Error;
  memcpy(*state, M, sizeof(Memory));
  return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate state) {
  memcpy(M, state, sizeof(Memory));
  return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate* state) {
  (void)component;
  free(*state);
  *state = NULL;
  return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component component, fmi2FMUstate state, size_t* size) {
  (void)component, (void)state;
  *size = sizeof(Memory);
  return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
  if (size < sizeof(Memory)) return told((Instance*)component, "too few bytes for the state");
  memcpy(bytes, state, sizeof(Memory));
  return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component component, const fmi2Byte bytes[], size_t size, fmi2FMUstate* state) {
  if (size != sizeof(Memory)) return told((Instance*)component, "these bytes are no state of this FMU");
  if (!*state) *state = malloc(sizeof(Memory));
  if (!*state) return fmi2Error;
  memcpy(*state, bytes, sizeof(Memory));
  return fmi2OK;
}

/* What an FMU of real variables that steps at once does not have. No value asked for is none lacking. */

#define NO_VARIABLES(Name, Type)                                                                                     \
  fmi2Status fmi2##Name(fmi2Component component, const fmi2ValueReference references[], size_t count, Type values) { \
    (void)references, (void)values;                                                                                  \
    return count ? lacking(component) : fmi2OK;                                                                      \
  }

NO_VARIABLES(GetInteger, fmi2Integer*)
NO_VARIABLES(GetBoolean, fmi2Boolean*)
NO_VARIABLES(GetString, fmi2String*)
NO_VARIABLES(SetInteger, const fmi2Integer*)
NO_VARIABLES(SetBoolean, const fmi2Boolean*)
NO_VARIABLES(SetString, const fmi2String*)

fmi2Status fmi2GetDirectionalDerivative(fmi2Component component, const fmi2ValueReference unknowns[], size_t rows,
                                        const fmi2ValueReference knowns[], size_t columns, const fmi2Real seed[],
                                        fmi2Real sensitivity[]) {
  (void)unknowns, (void)rows, (void)knowns, (void)columns, (void)seed, (void)sensitivity;
  return lacking(component);
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component component, const fmi2ValueReference references[], size_t count,
                                        const fmi2Integer orders[], fmi2Real values[]) {
  (void)references, (void)orders, (void)values;
  return count ? lacking(component) : fmi2OK;
}

fmi2Status fmi2CancelStep(fmi2Component component) { return lacking(component); }

#define NO_STATUS(Name, Type)                                                               \
  fmi2Status fmi2##Name(fmi2Component component, const fmi2StatusKind kind, Type* value) { \
    (void)kind, (void)value;                                                                \
    return lacking(component);                                                              \
  }

NO_STATUS(GetStatus, fmi2Status)
NO_STATUS(GetIntegerStatus, fmi2Integer)
NO_STATUS(GetStringStatus, fmi2String)

fmi2Status fmi2GetRealStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Real* value) {
  if (kind != fmi2LastSuccessfulTime) return lacking(component);
  *value = M->time;
  return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Boolean* value) {
  if (kind != fmi2Terminated) return lacking(component);
  *value = fmi2False;
  return fmi2OK;
}
