/* m x'' + d x' + k x = F with x(0) = x_0, for FMI 2.0: model exchange with directional derivatives, and co-simulation.

   Some stiffnesses are traps: 666 crashes, 667 hangs, 668 answers nan. WITHOUT_PARAMETERS lacks directional derivatives
   by parameters; FORGETFUL keeps a state over a reset. */
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <unistd.h>
#include "fmi2Functions.h"

enum { POSITION, VELOCITY, RATE_OF_POSITION, ACCELERATION, FORCE, K, D, M, X0, COUNT };

typedef struct {
    double v[COUNT], slope, time, wear;
} Model;

static void start(Model *m) {
    for (int i = 0; i < COUNT; i++) m->v[i] = 0;
    m->v[K] = 400; m->v[D] = 4; m->v[M] = 1; m->slope = m->time = 0;
}

static void evaluate(Model *m) {
    m->v[RATE_OF_POSITION] = m->v[VELOCITY];
    m->v[ACCELERATION] = (m->v[FORCE] - m->v[D] * m->v[VELOCITY] - (m->v[K] + m->wear) * m->v[POSITION]) / m->v[M];
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String s[]) { return fmi2OK; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String place,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    Model *m = calloc(1, sizeof(Model));
    start(m);
    return m;
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean t, fmi2Real tol, fmi2Real t0, fmi2Boolean s, fmi2Real t1) {
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Model *m = c;
    m->v[POSITION] = m->v[X0];
    if (m->v[K] == 666) raise(SIGSEGV);
    if (m->v[K] == 667) for (;;) usleep(1000);
    return fmi2OK;
}
fmi2Status fmi2Terminate(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2Reset(fmi2Component c) {
#ifdef FORGETFUL
    ((Model *)c)->wear += 50;
#endif
    start(c);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    Model *m = c;
    evaluate(m);
    for (size_t i = 0; i < n; i++) value[i] = m->v[K] == 668 && m->time > 0.3 ? NAN : m->v[vr[i]];
    return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) ((Model *)c)->v[vr[i]] = value[i];
    return fmi2OK;
}
#define EMPTY(name, type) \
    fmi2Status name(fmi2Component c, const fmi2ValueReference vr[], size_t n, type value[]) { return fmi2OK; }
EMPTY(fmi2GetInteger, fmi2Integer)
EMPTY(fmi2GetBoolean, fmi2Boolean)
EMPTY(fmi2GetString, fmi2String)
EMPTY(fmi2SetInteger, const fmi2Integer)
EMPTY(fmi2SetBoolean, const fmi2Boolean)
EMPTY(fmi2SetString, const fmi2String)

/* FMPy asks for these, whatever the description says */
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *s) { return fmi2Error; }
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate s) { return fmi2Error; }
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *s) { return fmi2Error; }
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate s, size_t *n) { return fmi2Error; }
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate s, fmi2Byte b[], size_t n) { return fmi2Error; }
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte b[], size_t n, fmi2FMUstate *s) { return fmi2Error; }

/* derivatives of RATE_OF_POSITION and ACCELERATION along a direction; a state among the unknowns is itself */
fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t nu,
                                        const fmi2ValueReference known[], size_t nk, const fmi2Real seed[],
                                        fmi2Real found[]) {
    Model *m = c;
    double by[COUNT] = {0};
    evaluate(m);
    for (size_t i = 0; i < nk; i++) by[known[i]] = seed[i];
#ifdef WITHOUT_PARAMETERS
    by[K] = by[D] = by[M] = 0;
#endif
    by[RATE_OF_POSITION] = by[VELOCITY];
    by[ACCELERATION] = (by[FORCE] - by[D] * m->v[VELOCITY] - m->v[D] * by[VELOCITY] - by[K] * m->v[POSITION]
                        - m->v[K] * by[POSITION] - by[M] * m->v[ACCELERATION]) / m->v[M];
    for (size_t i = 0; i < nu; i++) found[i] = by[unknown[i]];
    return fmi2OK;
}

fmi2Status fmi2EnterEventMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    info->newDiscreteStatesNeeded = info->terminateSimulation = info->nominalsOfContinuousStatesChanged =
        info->valuesOfContinuousStatesChanged = info->nextEventTimeDefined = fmi2False;
    return fmi2OK;
}
fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean n, fmi2Boolean *event, fmi2Boolean *end) {
    *event = *end = fmi2False;
    return fmi2OK;
}
fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) { ((Model *)c)->time = time; return fmi2OK; }
fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) {
    ((Model *)c)->v[POSITION] = x[0]; ((Model *)c)->v[VELOCITY] = x[1];
    return fmi2OK;
}
fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real dx[], size_t n) {
    evaluate(c);
    dx[0] = ((Model *)c)->v[RATE_OF_POSITION]; dx[1] = ((Model *)c)->v[ACCELERATION];
    return fmi2OK;
}
fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real z[], size_t n) { return fmi2OK; }
fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) {
    x[0] = ((Model *)c)->v[POSITION]; x[1] = ((Model *)c)->v[VELOCITY];
    return fmi2OK;
}
fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x[], size_t n) {
    x[0] = 0.1; x[1] = 1;
    return fmi2OK;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    ((Model *)c)->slope = value[0];
    return fmi2OK;
}
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                        const fmi2Integer order[], fmi2Real value[]) { return fmi2Error; }

static void rates(Model *m, const double x[2], double force, double dx[2]) {
    dx[0] = x[1];
    dx[1] = (force - m->v[D] * x[1] - (m->v[K] + m->wear) * x[0]) / m->v[M];
}

/* twenty steps of Runge and Kutta */
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real step, fmi2Boolean n) {
    Model *m = c;
    double h = step / 20, x[2] = {m->v[POSITION], m->v[VELOCITY]}, y[2], a[2], b[2], e[2], g[2];
    for (int i = 0; i < 20; i++) {
        double f = m->v[FORCE] + m->slope * i * h, half = f + m->slope * h / 2, next = f + m->slope * h;
        rates(m, x, f, a);
        for (int j = 0; j < 2; j++) y[j] = x[j] + h / 2 * a[j];
        rates(m, y, half, b);
        for (int j = 0; j < 2; j++) y[j] = x[j] + h / 2 * b[j];
        rates(m, y, half, e);
        for (int j = 0; j < 2; j++) y[j] = x[j] + h * e[j];
        rates(m, y, next, g);
        for (int j = 0; j < 2; j++) x[j] += h / 6 * (a[j] + 2 * b[j] + 2 * e[j] + g[j]);
    }
    m->v[POSITION] = x[0]; m->v[VELOCITY] = x[1];
    m->v[FORCE] += m->slope * step;
    m->time = t + step;
    return fmi2OK;
}
fmi2Status fmi2CancelStep(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *v) { return fmi2Discard; }
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *v) { return fmi2Discard; }
fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *v) { return fmi2Discard; }
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *v) { return fmi2Discard; }
fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *v) { return fmi2Discard; }
