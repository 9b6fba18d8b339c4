/* m x'' + d x' + k x = F with x(0) = x_0, for FMI 3.0: see oscillator_fmu.c. */
#include "fmi3Functions.h"
#include "oscillator_core.h"

#define STATUS(name, ...) fmi3Status name(fmi3Instance c, ##__VA_ARGS__)

static fmi3Instance instance(void) {
    Model *m = calloc(1, sizeof(Model));
    start(m);
    return m;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment e, fmi3LogMessageCallback log) {
    return instance();
}
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference required[], size_t n, fmi3InstanceEnvironment e,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    return instance();
}
void fmi3FreeInstance(fmi3Instance c) { free(c); }
STATUS(fmi3Reset) { start(c); return fmi3OK; }
STATUS(fmi3EnterInitializationMode, fmi3Boolean t, fmi3Float64 tol, fmi3Float64 t0, fmi3Boolean s, fmi3Float64 t1) {
    return fmi3OK;
}
STATUS(fmi3ExitInitializationMode) { begin(c); return fmi3OK; }
STATUS(fmi3EnterEventMode) { return fmi3OK; }
STATUS(fmi3EnterContinuousTimeMode) { return fmi3OK; }
STATUS(fmi3Terminate) { return fmi3OK; }
STATUS(fmi3UpdateDiscreteStates, fmi3Boolean *again, fmi3Boolean *end, fmi3Boolean *nominals, fmi3Boolean *values,
       fmi3Boolean *event, fmi3Float64 *next) {
    *again = *end = *nominals = *values = *event = fmi3False;
    return fmi3OK;
}
STATUS(fmi3GetFloat64, const fmi3ValueReference vr[], size_t n, fmi3Float64 value[], size_t nv) {
    for (size_t i = 0; i < n; i++) value[i] = value_of(c, vr[i]);
    return fmi3OK;
}
STATUS(fmi3SetFloat64, const fmi3ValueReference vr[], size_t n, const fmi3Float64 value[], size_t nv) {
    for (size_t i = 0; i < n; i++) ((Model *)c)->v[vr[i]] = value[i];
    return fmi3OK;
}
STATUS(fmi3GetDirectionalDerivative, const fmi3ValueReference unknown[], size_t nu, const fmi3ValueReference known[],
       size_t nk, const fmi3Float64 seed[], size_t ns, fmi3Float64 found[], size_t nf) {
    double by[COUNT] = {0};
    for (size_t i = 0; i < nk; i++) by[known[i]] = seed[i];
    along(c, by);
    for (size_t i = 0; i < nu; i++) found[i] = by[unknown[i]];
    return fmi3OK;
}
STATUS(fmi3CompletedIntegratorStep, fmi3Boolean n, fmi3Boolean *event, fmi3Boolean *end) {
    *event = *end = fmi3False;
    return fmi3OK;
}
STATUS(fmi3SetTime, fmi3Float64 time) { ((Model *)c)->time = time; return fmi3OK; }
STATUS(fmi3SetContinuousStates, const fmi3Float64 x[], size_t n) {
    ((Model *)c)->v[POSITION] = x[0]; ((Model *)c)->v[VELOCITY] = x[1];
    return fmi3OK;
}
STATUS(fmi3GetContinuousStates, fmi3Float64 x[], size_t n) {
    x[0] = ((Model *)c)->v[POSITION]; x[1] = ((Model *)c)->v[VELOCITY];
    return fmi3OK;
}
STATUS(fmi3GetContinuousStateDerivatives, fmi3Float64 dx[], size_t n) {
    dx[0] = value_of(c, RATE_OF_POSITION); dx[1] = value_of(c, ACCELERATION);
    return fmi3OK;
}
STATUS(fmi3GetNominalsOfContinuousStates, fmi3Float64 x[], size_t n) { x[0] = 0.1; x[1] = 1; return fmi3OK; }
STATUS(fmi3GetEventIndicators, fmi3Float64 z[], size_t n) { return fmi3OK; }
STATUS(fmi3DoStep, fmi3Float64 t, fmi3Float64 step, fmi3Boolean n, fmi3Boolean *event, fmi3Boolean *end,
       fmi3Boolean *early, fmi3Float64 *last) {
    do_step(c, t, step);
    *event = *end = *early = fmi3False;
    *last = t + step;
    return fmi3OK;
}
