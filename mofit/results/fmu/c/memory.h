/* What an instance holds, the inputs between communication points, and the equations as functions of it.
 *
 * Copyright (c) the mofit developers. MIT licence, see documentation/licenses.
 *
 * Everything is static and kept in a `Memory`, which holds no pointer: instances are independent, a copy of the bytes
 * is the whole state, and several FMUs may be linked into one program.
 */
#ifndef MEMORY_H
#define MEMORY_H

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "model.h"

/* arrays of C have at least one element */
#define SIZE(n) ((n) > 0 ? (n) : 1)

/* value references: time, then what can be set, then what is calculated */
#define FIRST_INPUT 1
#define FIRST_PARAMETER (FIRST_INPUT + CHANNELS * ORDERS)
#define FIRST_CONDITION (FIRST_PARAMETER + PARAMETERS)
#define FIRST_OUTPUT (FIRST_CONDITION + CONDITIONS)
#define FIRST_STATE (FIRST_OUTPUT + OUTPUTS)
#define END (FIRST_STATE + STATES)
#define SETTABLE (FIRST_OUTPUT - FIRST_INPUT)

/* steps of the integrator within one communication step, after which it gives up */
#define MOST_STEPS 200000
#define LEAST_TOLERANCE 1e-12
#define LARGEST_TOLERANCE 1e-2

typedef enum { INSTANTIATED, INITIALISING, STEPPING, TERMINATED } Mode;

typedef struct {
  Mode mode;
  double tolerance;               /* error of a step relative to the size of the states */
  double start_time, time;        /* s */
  double set[SIZE(SETTABLE)];     /* inputs with their derivatives, parameters, conditions */
  unsigned char given[SIZE(CHANNELS * ORDERS)]; /* derivatives that the importer has set */
  double curve[SIZE(CHANNELS * ORDERS)];        /* inputs and derivatives at the communication point */
  double before[SIZE(CHANNELS * ORDERS)];       /* the same at the last one */
  double since, last_step;        /* s since the communication point; length of the step before it */
  double x[SIZE(STATES)];
  double step;                    /* that the integrator takes next, s; 0: not known */
} Memory;

static void reset(Memory* m) {
  memset(m, 0, sizeof *m);
  m->tolerance = MODEL_TOLERANCE;
  memcpy(m->set, model_start, sizeof m->set);
}

/* The inputs as they run from now on. A derivative that is not given is that of the values at the last two
 * communication points where the equations read it, else 0. */
static void begin_curve(Memory* m) {
  int channel, order;
  for (channel = 0; channel < CHANNELS; channel++)
    for (order = 0; order < ORDERS; order++) {
      const int at = channel * ORDERS + order;
      if (order == 0 || m->given[at])
        m->curve[at] = m->set[at];
      else if (order <= model_read[channel] && m->last_step > 0)
        m->curve[at] = (m->curve[at - 1] - m->before[at - 1]) / m->last_step;
      else
        m->curve[at] = 0;
    }
  m->since = 0;
}

/* Inputs of the equations, and their rates, at a time after the communication point: polynomials. */
static void inputs_at(const Memory* m, double since, double* u, double* rate) {
  int k, order;
  for (k = 0; k < INPUTS; k++) {
    if (model_channel[k] < 0) { /* time */
      u[k] = m->time - m->start_time + (since - m->since);
      rate[k] = 1;
      continue;
    }
    const double* curve = m->curve + model_channel[k] * ORDERS;
    u[k] = rate[k] = 0;
    for (order = ORDERS - 1; order >= model_order[k]; order--) {
      const double terms = order - model_order[k];
      u[k] = curve[order] + u[k] * since / (terms + 1);
      if (order > model_order[k]) rate[k] = curve[order] + rate[k] * since / terms;
    }
  }
}

#define PARAMETERS_OF(m) ((m)->set + FIRST_PARAMETER - FIRST_INPUT)
#define CONDITIONS_OF(m) ((m)->set + FIRST_CONDITION - FIRST_INPUT)

static void call(int (*function)(const double**, double**, int*, double*, int), const double** arg, double** res) {
  int iw[SIZE(MODEL_INTEGERS)];
  double w[SIZE(MODEL_WORK)];
  function(arg, res, iw, w, 0);
}

static void slope(const Memory* m, double since, const double* x, double* xdot) {
  double u[SIZE(INPUTS)], rate[SIZE(INPUTS)];
  const double* arg[MODEL_POINTERS] = {x, u, PARAMETERS_OF(m), CONDITIONS_OF(m)};
  double* res[MODEL_POINTERS] = {xdot};
  inputs_at(m, since, u, rate);
  call(model_slope, arg, res);
}

/* State derivative, its derivatives by the state (column by column) and by time. */
static void linearised(const Memory* m, const double* x, double* xdot, double* jacobian, double* drift, double since) {
  double u[SIZE(INPUTS)], rate[SIZE(INPUTS)];
  const double* arg[MODEL_POINTERS] = {x, u, rate, PARAMETERS_OF(m), CONDITIONS_OF(m)};
  double* res[MODEL_POINTERS] = {xdot, jacobian, drift};
  inputs_at(m, since, u, rate);
  call(model_linearised, arg, res);
}

static void outputs(const Memory* m, double* y) {
  double u[SIZE(INPUTS)], rate[SIZE(INPUTS)];
  const double* arg[MODEL_POINTERS] = {m->x, u, PARAMETERS_OF(m), CONDITIONS_OF(m)};
  double* res[MODEL_POINTERS] = {y};
  inputs_at(m, m->since, u, rate);
  call(model_output, arg, res);
}

static void initial_state(Memory* m) {
  double u[SIZE(INPUTS)], rate[SIZE(INPUTS)];
  const double* arg[MODEL_POINTERS] = {u, PARAMETERS_OF(m), CONDITIONS_OF(m)};
  double* res[MODEL_POINTERS] = {m->x};
  begin_curve(m);
  inputs_at(m, 0, u, rate);
  call(model_initial, arg, res);
}

#endif
