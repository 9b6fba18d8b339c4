/* Co-simulation of an identified model, without the words of a version of FMI.
 *
 * Copyright (c) the mofit developers. MIT licence, see documentation/licenses.
 */
#ifndef COSIMULATION_H
#define COSIMULATION_H

#include "rodas4.h"

static const char* check_finite(double value) {
  return isfinite(value) ? NULL : "a value that is not finite was refused";
}

/* All that follow return what went wrong, or 0. */

static const char* set_value(Memory* m, unsigned reference, double value) {
  if (reference < FIRST_INPUT || reference >= FIRST_OUTPUT) return "this variable cannot be set";
  if (check_finite(value)) return check_finite(value);
  m->set[reference - FIRST_INPUT] = value;
  if (reference < FIRST_PARAMETER) {
    /* an importer that has no derivative sets none, or its start value, 0 */
    if (value != 0) m->given[reference - FIRST_INPUT] = 1;
    begin_curve(m);
  }
  return NULL;
}

static const char* get_values(Memory* m, const unsigned* references, size_t count, double* values) {
  double y[SIZE(OUTPUTS)];
  size_t k;
  int known = 0;
  if (m->mode == INSTANTIATED || m->mode == INITIALISING) initial_state(m);
  for (k = 0; k < count; k++) {
    const unsigned reference = references[k];
    if (reference == 0)
      values[k] = m->time;
    else if (reference < FIRST_OUTPUT)
      values[k] = m->set[reference - FIRST_INPUT];
    else if (reference < FIRST_STATE) {
      if (!known) outputs(m, y);
      known = 1;
      values[k] = y[reference - FIRST_OUTPUT];
    } else if (reference < END)
      values[k] = m->x[reference - FIRST_STATE];
    else
      return "there is no variable with this value reference";
  }
  return NULL;
}

static void begin_initialisation(Memory* m, int has_tolerance, double tolerance, double start_time) {
  if (has_tolerance && tolerance > 0) m->tolerance = fmin(LARGEST_TOLERANCE, fmax(LEAST_TOLERANCE, tolerance));
  m->start_time = m->time = start_time;
}

static const char* end_initialisation(Memory* m) {
  int k;
  if (m->mode != INITIALISING) return "the FMU is not in initialization mode";
  initial_state(m);
  m->mode = STEPPING;
  for (k = 0; k < STATES; k++)
    if (!isfinite(m->x[k])) return "the initial state is not finite: check inputs, parameters and conditions";
  return NULL;
}

static const char* do_step(Memory* m, double time, double length) {
  Memory start;
  if (m->mode != STEPPING) return "a step is possible only after initialization";
  if (!isfinite(time) || !isfinite(length) || !(length > 0)) return "the communication step is not positive";
  if (fabs(time - m->time) > 1e-6 * length + 1e-12 * fabs(time))
    return "the communication point is not the end of the last step";
  start = *m;
  m->time = time;
  begin_curve(m);
  if (STATES > 0 && !integrate(m, length)) {
    *m = start;
    return "the integrator found no step within the tolerance: the equations are singular or discontinuous here";
  }
  memcpy(m->before, m->curve, sizeof m->before);
  m->since = m->last_step = length;
  m->time = time + length;
  return NULL;
}

#endif
