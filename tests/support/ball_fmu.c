/* A ball dropped from 1 m that bounces: h'' = -g, and v becomes -e v at the ground. FMI 2.0, model exchange, one event
   indicator. */
#include <stdlib.h>
#include "fmi2Functions.h"

enum { HEIGHT, SPEED, RATE, FALL, G, E, COUNT };
typedef struct { double v[COUNT]; } Ball;

static void start(Ball *b) {
    for (int i = 0; i < COUNT; i++) b->v[i] = 0;
    b->v[HEIGHT] = 1; b->v[G] = 9.81; b->v[E] = 0.7;
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String place,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    Ball *b = calloc(1, sizeof(Ball));
    start(b);
    return b;
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean t, fmi2Real tol, fmi2Real t0, fmi2Boolean s, fmi2Real t1) {
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2Reset(fmi2Component c) { start(c); return fmi2OK; }
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) value[i] = ((Ball *)c)->v[vr[i]];
    return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) ((Ball *)c)->v[vr[i]] = value[i];
    return fmi2OK;
}
fmi2Status fmi2EnterEventMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    Ball *b = c;
    info->newDiscreteStatesNeeded = info->terminateSimulation = info->nominalsOfContinuousStatesChanged =
        info->valuesOfContinuousStatesChanged = info->nextEventTimeDefined = fmi2False;
    if (b->v[HEIGHT] <= 0 && b->v[SPEED] < 0) {
        b->v[HEIGHT] = 1e-12;
        b->v[SPEED] *= -b->v[E];
        info->valuesOfContinuousStatesChanged = fmi2True;
    }
    return fmi2OK;
}
fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean n, fmi2Boolean *event, fmi2Boolean *end) {
    *event = *end = fmi2False;
    return fmi2OK;
}
fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) { return fmi2OK; }
fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) {
    ((Ball *)c)->v[HEIGHT] = x[0]; ((Ball *)c)->v[SPEED] = x[1];
    return fmi2OK;
}
fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real dx[], size_t n) {
    dx[0] = ((Ball *)c)->v[SPEED]; dx[1] = -((Ball *)c)->v[G];
    return fmi2OK;
}
fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real z[], size_t n) {
    z[0] = ((Ball *)c)->v[HEIGHT];
    return fmi2OK;
}
fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) {
    x[0] = ((Ball *)c)->v[HEIGHT]; x[1] = ((Ball *)c)->v[SPEED];
    return fmi2OK;
}
fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x[], size_t n) { x[0] = x[1] = 1; return fmi2OK; }
