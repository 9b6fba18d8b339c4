/* The oscillator itself, whatever the version of FMI. */
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <unistd.h>

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

/* where a stiffness crashes, hangs, answers nan: at single values, or with HOSTILE in whole ranges */
static int trapped(Model *m, double value, double low, double high) {
#ifdef HOSTILE
    return m->v[K] > low && m->v[K] < high;
#else
    return m->v[K] == value;
#endif
}

static void begin(Model *m) {
    m->v[POSITION] = m->v[X0];
    if (trapped(m, 666, 1000, 1500)) raise(SIGSEGV);
    if (trapped(m, 667, 1500, 1520)) for (;;) usleep(1000);
}

static double value_of(Model *m, unsigned reference) {
    evaluate(m);
    return trapped(m, 668, 1520, 2500) && m->time > 0.3 ? NAN : m->v[reference];
}

/* derivatives of RATE_OF_POSITION and ACCELERATION along a direction, beside those of the knowns themselves */
static void along(Model *m, double by[COUNT]) {
    evaluate(m);
#ifdef WITHOUT_PARAMETERS
    by[K] = by[D] = by[M] = 0;
#endif
    by[RATE_OF_POSITION] = by[VELOCITY];
    by[ACCELERATION] = (by[FORCE] - by[D] * m->v[VELOCITY] - m->v[D] * by[VELOCITY] - by[K] * m->v[POSITION]
                        - m->v[K] * by[POSITION] - by[M] * m->v[ACCELERATION]) / m->v[M];
}

static void rates(Model *m, const double x[2], double force, double dx[2]) {
    dx[0] = x[1];
    dx[1] = (force - m->v[D] * x[1] - (m->v[K] + m->wear) * x[0]) / m->v[M];
}

/* twenty steps of Runge and Kutta */
static void do_step(Model *m, double t, double step) {
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
}
