/* Where the axis wants its carriage to be, between one setpoint and the next.
 *
 * Whole numbers only: positions in 1/256 increment, velocities in 1/256 increment per second,
 * time in microseconds, divisions rounded down. Nothing overflows 64 bits as long as positions
 * fit 32 bits of increments and the period is at most 2.55 s. */
#ifndef LAX_DEMAND_H
#define LAX_DEMAND_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define LAX_FRACTION INT64_C(256)     /* parts of an increment */
#define LAX_SECOND INT64_C(1000000)   /* [us] */

typedef enum {
    LAX_HOLD,   /* it stands */
    LAX_FOLLOW, /* it goes to a setpoint, and past it for one period if no other comes */
    LAX_BRAKE   /* it slows down to a stand */
} lax_phase_t;

typedef struct {
    lax_phase_t phase;
    int64_t position; /* [1/256 increment] */
    int64_t velocity; /* [1/256 increment/s] */
    int64_t start;
    int64_t end;
    int64_t elapsed; /* since the setpoint was latched [us] */
    int64_t period;  /* [us] */
} lax_demand_t;

int64_t lax_floor_div(int64_t a, int64_t b);
void lax_demand_init(lax_demand_t *demand);
void lax_demand_place(lax_demand_t *demand, int64_t increments);
void lax_demand_aim(lax_demand_t *demand, int64_t increments, int64_t period);
void lax_demand_brake(lax_demand_t *demand);
void lax_demand_advance(lax_demand_t *demand, int64_t dt, int64_t deceleration);

#ifdef __cplusplus
}
#endif

#endif
